//! Everything that can be wrong, and how to mend it.

use activity::spec::SpecError;

use crate::quantity::OutOfRange;

/// Why an energy table could not be used.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The file cannot be read, is not RON, or one of its rows is wrong in itself.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// No table of that name comes with the crate.
    #[error("no built-in energy table is called `{name}`: {mend}")]
    Unknown {
        /// The name asked for.
        name: String,
        /// The nearest known name.
        mend: String,
    },
    /// An event has two rows.
    #[error("{path}: event `{event}` is listed more than once: keep one row")]
    Duplicate {
        /// The file.
        path: String,
        /// The event.
        event: &'static str,
    },
    /// An event has no row.
    #[error("{path}: event `{event}` has no row: add one under `rows`, or under `free` with the reason")]
    Missing {
        /// The file.
        path: String,
        /// The event.
        event: &'static str,
    },
    /// The reference voltage is outside the table's own range.
    #[error("{path}: v0_v is not between v_min_v and v_max_v: put v_min_v <= v0_v <= v_max_v")]
    Voltages {
        /// The file.
        path: String,
    },
}

/// Why a platform could not be used.
#[derive(Debug, thiserror::Error)]
pub enum PlatformError {
    /// The file cannot be read, is not RON, or one of its numbers is wrong in itself.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// No platform of that name comes with the crate.
    #[error("no built-in platform is called `{name}`: {mend}")]
    Unknown {
        /// The name asked for.
        name: String,
        /// The nearest known name.
        mend: String,
    },
    /// A unit has two rows under `units`.
    #[error("{path}: unit `{unit}` is listed more than once under `units`: keep one row")]
    DuplicateUnit {
        /// The file.
        path: String,
        /// The unit.
        unit: &'static str,
    },
    /// A unit has no row under `units`.
    #[error("{path}: unit `{unit}` has no row under `units`: add one")]
    MissingUnit {
        /// The file.
        path: String,
        /// The unit.
        unit: &'static str,
    },
    /// Two disturbances have one name.
    #[error(
        "{path}: disturbance `{name}` is listed more than once under `system`: keep one, or name them apart"
    )]
    DuplicateDisturbance {
        /// The file.
        path: String,
        /// The name.
        name: String,
    },
    /// An event is overridden twice.
    #[error("{path}: event `{event}` is listed more than once under `energy_rows`: keep one row")]
    DuplicateRow {
        /// The file.
        path: String,
        /// The event.
        event: &'static str,
    },
}

/// Why a table and a platform do not go together.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// The platform is made on another process node than the table describes.
    #[error(
        "platform `{platform}` is a {platform_nm} nm part but energy table `{table}` is for {table_nm} nm: \
         use a table for its node, or scale one with `energy_from`"
    )]
    Node {
        /// The platform.
        platform: String,
        /// The node of the tables it takes, in nanometres.
        platform_nm: u32,
        /// The table.
        table: String,
        /// The table's node in nanometres.
        table_nm: u32,
    },
    /// The core voltage is outside the range over which the table's scaling holds.
    #[error(
        "platform `{platform}` runs at {v_v} V but energy table `{table}` scales only from {low_v} to \
         {high_v} V: change v_v, or use a table for that voltage"
    )]
    Voltage {
        /// The platform.
        platform: String,
        /// Its core voltage.
        v_v: f64,
        /// The table.
        table: String,
        /// The lowest voltage the table scales to.
        low_v: f64,
        /// The highest voltage the table scales to.
        high_v: f64,
    },
    /// Leakage at the voltage and temperature of the platform is more than any supply delivers.
    #[error(
        "platform `{platform}` leaks {leakage_w:.3e} W at its voltage and temperature, more than {most_w} W: check          leakage.doubling_c, leakage.voltage_exponent and v0_v"
    )]
    Leakage {
        /// The platform.
        platform: String,
        /// The leakage, W.
        leakage_w: f64,
        /// The most there can be, W.
        most_w: f64,
    },
}

/// Why a timeline cannot be turned into watts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TimelineError {
    /// Bins have no length.
    #[error("the timeline's bins are 0 ps long: make them at least 1 ps")]
    EmptyBin,
    /// The bins end before the frame does.
    #[error(
        "the timeline has {bins} bins of {bin_ps} ps for a frame of {duration_ps} ps: add bins up to its end"
    )]
    TooShort {
        /// How many bins there are.
        bins: usize,
        /// Length of each in picoseconds.
        bin_ps: u64,
        /// Length of the frame in picoseconds.
        duration_ps: u64,
    },
    /// Something happens in a bin that begins at or after the end of the frame.
    #[error("bin {bin} of the timeline is active although the frame has ended: make duration_ps cover it")]
    AfterEnd {
        /// The bin, counted from 0.
        bin: usize,
    },
    /// A unit is busy for longer than the bin, cut at the end of the frame, lasts.
    #[error(
        "bin {bin} of the timeline has unit `{unit}` busy for {busy_ps} of {length_ps} ps: count a unit once \
         however many copies of it work, and end the frame after its last work"
    )]
    TooBusy {
        /// The bin, counted from 0.
        bin: usize,
        /// The unit.
        unit: &'static str,
        /// How long it is said to be busy, in picoseconds.
        busy_ps: u64,
        /// How long the bin lasts, in picoseconds.
        length_ps: u64,
    },
}

/// Why frames could not be paced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PacingError {
    /// There is nothing to pace.
    #[error("there are no frames to pace: render at least one")]
    NoFrames,
    /// The V-sync rate is not usable.
    #[error("the V-sync rate: {0}")]
    Rate(#[from] OutOfRange),
    /// The run lasts longer than a clock of 64 bits of picoseconds.
    #[error("the run lasts more than 213 days: pace fewer frames")]
    TooLong,
    /// More disturbances than anyone can look at.
    #[error("the run of {run_s} s would have more than {most} disturbances: shorten it, or make them rarer")]
    TooDisturbed {
        /// Length of the run, s.
        run_s: f64,
        /// The most there can be.
        most: usize,
    },
    /// The power curve refused a step.
    #[error("the power curve of the run: {0}")]
    Curve(#[from] traces::CurveError),
}
