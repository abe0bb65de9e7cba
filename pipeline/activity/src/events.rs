//! Units and events, each declared once.

use std::ops::Range;

use serde::{Deserialize, Serialize};

/// Declare the units and their events: `Name "name in files" "documentation"`.
macro_rules! activity {
    ($($unit:ident $unit_name:literal $unit_doc:literal {
        $($event:ident $event_name:literal $event_doc:literal)*
    })*) => {
        /// A unit of the block diagram, in the order of the pipeline.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum Unit { $(#[doc = $unit_doc] $unit),* }

        impl Unit {
            /// Every unit, in declaration order.
            pub const ALL: [Self; [$(Self::$unit),*].len()] = [$(Self::$unit),*];

            /// Name in files, for example `sample_test`.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$unit => $unit_name),* }
            }

            /// One sentence: what the unit does.
            pub const fn doc(self) -> &'static str {
                match self { $(Self::$unit => $unit_doc),* }
            }
        }

        /// A countable action of a unit. Its energy is in the energy tables, its rate in the GPU files.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(into = "&'static str", try_from = "String")]
        #[repr(u8)]
        pub enum Event { $($(#[doc = $event_doc] $event),*),* }

        impl Event {
            /// Every event, grouped by unit, in declaration order.
            pub const ALL: [Self; [$($(Self::$event),*),*].len()] = [$($(Self::$event),*),*];

            /// Name in files and energy tables, for example `samples_tested`.
            pub const fn name(self) -> &'static str {
                match self { $($(Self::$event => $event_name),*),* }
            }

            /// One sentence: what one event is.
            pub const fn doc(self) -> &'static str {
                match self { $($(Self::$event => $event_doc),*),* }
            }

            /// The unit that performs it.
            pub const fn unit(self) -> Unit {
                match self { $($(Self::$event => Unit::$unit),*),* }
            }
        }
    };
}

activity! {
    Command "command" "Reads draws and indices and fetches vertices." {
        Draws "draws" "A draw or a dispatch of groups taken from the command stream."
        Indices "indices" "A vertex index read."
        VerticesFetched "vertices_fetched" "A vertex read after the reuse of recent ones."
        VertexBytes "vertex_bytes" "A byte of vertex data read, both ends of the shutter counted."
    }
    Shader "shader" "The shader cores, shared by vertex and pixel work." {
        VertexInvocations "vertex_invocations" "A vertex shader run."
        PixelInvocations "pixel_invocations" "A pixel shader lane run, helper lanes included."
        HelperInvocations "helper_invocations" "A lane run only to complete a quad."
        CentroidInvocations "centroid_invocations" "Of the pixel lanes: one at the centroid of the samples that its triangle covers."
        ShaderOps "shader_ops" "A multiply-add or simpler operation of one shader lane."
    }
    Compute "compute" "Starts groups of lanes on the shader cores; has their shared memory, buffers, atomics and barriers." {
        Groups "groups" "A group started on a core."
        GroupLanes "group_lanes" "A lane run in a group, helper lanes included."
        GroupHelperLanes "group_helper_lanes" "Of these: a lane run only to complete a warp."
        GroupSteps "group_steps" "An operation on the longest way through a group: between barriers, of its longest warp."
        GroupBarriers "group_barriers" "A warp that waits at a barrier of its group."
        SharedBytes "shared_bytes" "A byte of shared memory held by a group."
        SharedAccesses "shared_accesses" "A word of shared memory read or written by a lane."
        SharedCycles "shared_cycles" "A cycle of a shared memory: one for an access of a warp, and one for each bank conflict."
        BankConflicts "bank_conflicts" "Of these: a cycle more because lanes of a warp ask one bank for several words."
        Atomics "atomics" "An atomic operation of a lane on a word of a buffer."
        AtomicConflicts "atomic_conflicts" "Of these: one that waits for another of its warp on the same word."
        AtomicSteps "atomic_steps" "A step of an atomic unit: all words of a line once. Equal words take a step each."
        BufferLines "buffer_lines" "A line of a buffer read, written or changed by a warp."
    }
    Setup "setup" "Prepares a triangle for traversal." {
        TrianglesIn "triangles_in" "A triangle that enters set-up."
        TrianglesDegenerate "triangles_degenerate" "A triangle dropped because two of its corners are one at all times."
        TrianglesFlat "triangles_flat" "A triangle kept although its corners lie on one line at all times: rounding may give it an area."
        TrianglesOutside "triangles_outside" "A triangle dropped because it is outside the view at all times."
        TrianglesFaceCulled "triangles_face_culled" "A triangle dropped because it always shows a culled face."
        TrianglesSetUp "triangles_set_up" "A triangle that goes on to traversal."
        BinEntries "bin_entries" "A triangle entered in the list of a bin."
        BinLinesWritten "bin_lines_written" "A line of set-up records or lists of bins written to the triangle buffer."
        SetupMadds "setup_madds" "A multiply-add of triangle set-up."
    }
    Traversal "traversal" "Finds the tiles a triangle may touch, with the u, v, t box of each." {
        CoarseTilesVisited "coarse_tiles_visited" "A coarse tile tested."
        BinLinesRead "bin_lines_read" "A line of set-up records or lists of bins read from the triangle buffer."
        BinMisses "bin_misses" "A line read that was not in the triangle buffer."
        TilesVisited "tiles_visited" "A fine tile tested."
        TilesCulledSides "tiles_culled_sides" "A tile, coarse or fine, culled by the side planes over u, v and t."
        TilesCulledLens "tiles_culled_lens" "A tile, coarse or fine, culled by the dual-space lens lines."
        TilesCulledFacing "tiles_culled_facing" "A tile, coarse or fine, culled because no face that is drawn can be seen."
        TilesCulledEdges "tiles_culled_edges" "A tile, coarse or fine, culled by the edges."
        TileMadds "tile_madds" "A multiply-add of a tile test, of whichever kind."
        LensLineMadds "lens_line_madds" "Of these: a multiply-add of the dual-space lens lines."
        SidePlaneMadds "side_plane_madds" "Of these: a multiply-add of the side planes."
        EdgeMadds "edge_madds" "Of these: a multiply-add of bringing the edges to a tile, shared by facing, edge bounds and screens."
        FacingMadds "facing_madds" "Of these: a multiply-add of finding the face that is seen."
        EdgeBoundMadds "edge_bound_madds" "Of these: a multiply-add of bounding the edges and the time they leave."
        ScreenSetupMadds "screen_setup_madds" "Of these: a multiply-add of linearizing the edges to screen samples by."
    }
    ZCull "z_cull" "Drops tiles whose every sample is known to be hidden." {
        ZCullTests "z_cull_tests" "A depth interval compared with the farthest and nearest depth of a box of lens and time of a tile."
        TilesCulledZMax "tiles_culled_z_max" "A tile culled because no sample of the triangle can pass the depth test in it."
        BoxesCulledZMax "boxes_culled_z_max" "A box of lens and time of a tile in which no sample of the triangle can pass the depth test."
        ZMaxUpdates "z_max_updates" "The farthest depth of a box of lens and time written anew."
        ZMinUpdates "z_min_updates" "The nearest depth of a box of lens and time written anew."
        DepthIntervalMadds "depth_interval_madds" "A multiply-add spent on a depth interval."
    }
    SampleTest "sample_test" "Tests samples against the edges of a triangle." {
        SampleReads "sample_reads" "A sample's x, y, u, v, t read from the sample table, to be screened or tested."
        SamplesScreened "samples_screened" "A sample screened by the linearized edges before it is tested."
        ScreenMadds "screen_madds" "A multiply-add of screening a sample."
        SamplesTested "samples_tested" "A sample tested against a triangle."
        SamplesHit "samples_hit" "A sample found inside the triangle and beyond the near depth."
        SampleMadds "sample_madds" "A multiply-add of a sample test, the depth at the sample included."
    }
    Depth "depth" "Compares and stores the depth of each sample." {
        DepthReads "depth_reads" "A stored sample depth read for a comparison."
        DepthReadsSkipped "depth_reads_skipped" "A comparison spared because its result is known for the tile, or for every depth."
        DepthWrites "depth_writes" "A word of depth and stencil written."
        DepthLines "depth_lines" "A line of the depth cache accessed."
        DepthMisses "depth_misses" "A line that was not in the depth cache."
    }
    ShadingCache "shading_cache" "Remembers shaded quads by triangle and shading-grid cell." {
        ShadingLookups "shading_lookups" "A look-up for one visible sample."
        ShadingHits "shading_hits" "A look-up that found its quad."
        QuadsShaded "quads_shaded" "A quad sent to the shader cores because it was not found."
    }
    Texture "texture" "Filters textures through a cache of its own." {
        TextureFetches "texture_fetches" "A bilinear filtered fetch; a trilinear one counts as two."
        TextureLines "texture_lines" "A line of the texture cache accessed."
        TextureMisses "texture_misses" "A line that was not in the texture cache."
    }
    Colour "colour" "Stores sample colours and resolves them into pixels." {
        ColourWrites "colour_writes" "A word of a sample colour written, in each target."
        SamplesBlended "samples_blended" "Of these: a colour that is combined with the stored one, or replaces a part of it."
        ColourLines "colour_lines" "A line of the colour cache accessed."
        ColourMisses "colour_misses" "A line that was not in the colour cache."
        SamplesResolved "samples_resolved" "A word of a sample colour read to resolve its pixel."
        PixelsResolved "pixels_resolved" "A word of a pixel of an image written."
    }
    L2 "l2" "The cache shared by all clients of memory." {
        L2Reads "l2_reads" "A line read by a client."
        L2Writes "l2_writes" "A line written back by a client."
        L2Misses "l2_misses" "A line that was not in the L2."
    }
    Llc "llc" "The last-level cache below the L2, shared with the CPU where the GPU is part of a processor." {
        LlcReads "llc_reads" "A line read by the L2."
        LlcWrites "llc_writes" "A line written back by the L2."
        LlcMisses "llc_misses" "A line that was not in the last-level cache."
        LlcWritebacks "llc_writebacks" "A dirty line written back to the eDRAM or to memory."
    }
    Edram "edram" "Embedded DRAM between the caches of the chip and memory." {
        EdramReads "edram_reads" "A line read by the level above."
        EdramWrites "edram_writes" "A line written back by the level above."
        EdramMisses "edram_misses" "A line that was not in the eDRAM."
        EdramWritebacks "edram_writebacks" "A dirty line written back to memory."
    }
    Dram "dram" "Off-chip memory." {
        DramReadBytes "dram_read_bytes" "A byte read from memory."
        DramWriteBytes "dram_write_bytes" "A byte written to memory."
    }
}

impl Unit {
    /// Number of units.
    pub const COUNT: usize = Self::ALL.len();

    /// The unit with this name in files.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.name() == name)
    }

    /// Whether a GPU may lack it. Results leave it out if nothing happened in it.
    pub const fn is_optional(self) -> bool {
        matches!(self, Self::Compute | Self::Llc | Self::Edram)
    }

    /// Index range of its events in [`Event::ALL`].
    pub const fn events(self) -> Range<usize> {
        let (mut first, mut end) = (0, Event::COUNT);
        while Event::ALL[first].unit() as u8 != self as u8 {
            first += 1;
        }
        while Event::ALL[end - 1].unit() as u8 != self as u8 {
            end -= 1;
        }
        first..end
    }
}

impl Event {
    /// Number of events.
    pub const COUNT: usize = Self::ALL.len();

    /// The event with this name in files.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|event| event.name() == name)
    }
}

impl From<Event> for &'static str {
    fn from(event: Event) -> Self {
        event.name()
    }
}

impl TryFrom<String> for Event {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        Self::from_name(&name).ok_or_else(|| format!("no counter is called `{name}`"))
    }
}

/// Index of the first event and one past the last, by unit.
pub(crate) const EVENTS: [(usize, usize); Unit::COUNT] = {
    let mut ranges = [(0, 0); Unit::COUNT];
    let mut at = 0;
    while at < Unit::COUNT {
        let range = Unit::ALL[at].events();
        ranges[at] = (range.start, range.end);
        at += 1;
    }
    ranges
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_lead_back() {
        for event in Event::ALL {
            assert_eq!(Event::from_name(event.name()), Some(event));
        }
        for unit in Unit::ALL {
            assert_eq!(Unit::from_name(unit.name()), Some(unit));
        }
        assert_eq!(Event::from_name("no such thing"), None);
    }

    #[test]
    fn discriminants_index_the_list() {
        for (index, event) in Event::ALL.into_iter().enumerate() {
            assert_eq!(event as usize, index);
        }
        for (index, unit) in Unit::ALL.into_iter().enumerate() {
            assert_eq!(unit as usize, index);
        }
    }

    #[test]
    fn events_of_a_unit_lie_side_by_side() {
        for unit in Unit::ALL {
            let range = unit.events();
            for (at, event) in Event::ALL.into_iter().enumerate() {
                assert_eq!(event.unit() == unit, range.contains(&at), "{event:?}");
            }
        }
    }

    #[test]
    fn every_unit_counts_something() {
        for unit in Unit::ALL {
            assert!(Event::ALL.iter().any(|event| event.unit() == unit), "{unit:?}");
        }
    }
}
