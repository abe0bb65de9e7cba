//! Energy of a megapixel that is filled and written to memory, at the low, nominal and high end of the table.

use activity::{Counts, Event};
use power_model::{Bound, EnergyTable, Platform, PowerModel};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (table, platform) = (EnergyTable::builtin("28nm")?, Platform::builtin("reference")?);
    let mut counts = Counts::default();
    counts[Event::ColourWrites] = 1 << 20;
    counts[Event::DramWriteBytes] = 4 << 20;
    for bound in Bound::ALL {
        let energy = PowerModel::at(&table, &platform, bound)?.counts_energy(&counts);
        println!("{bound:?}: {:.3} mJ", 1e3 * energy.total_j());
        for (part, joules) in energy.iter().filter(|(_, joules)| *joules > 0.0) {
            println!("    {}: {:.3} mJ", part.name(), 1e3 * joules);
        }
    }
    Ok(())
}
