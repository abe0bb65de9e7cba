//! Rows of memory in the order of the stream.

use activity::{LineAccess, LineKind};

use crate::address::Map;
use crate::clock::{Clocks, Time};
use crate::job::{CLIENTS, port};
use crate::spec::MachineSpec;

/// For how long each bank opens and closes rows, if each client's lines come in the order of the stream and lines of others
/// never close a row of theirs: the least that can be.
#[derive(Clone, Debug)]
pub(super) struct Banks {
    map: Map,
    banks: usize,
    /// To close a row and open another. Its lines are moved meanwhile, as row and column commands have wires of their own.
    row: Time,
    /// Of each bank and client the last row.
    rows: Vec<[u32; CLIENTS.len()]>,
    busy: Vec<Time>,
}

impl Banks {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = &machine.dram;
        let banks = spec.banks.get() as usize;
        let all = spec.channels.get() as usize * banks;
        let row = spec.precharge_cycles.get() + spec.activate_cycles.get();
        Self {
            map: Map::new(spec),
            banks,
            row: clocks.period(spec.clock) * Time::from(row),
            rows: vec![[u32::MAX; CLIENTS.len()]; all],
            busy: vec![0; all],
        }
    }

    /// The lines of a packet.
    pub fn add(&mut self, lines: &[LineAccess]) {
        for access in lines.iter().filter(|access| access.kind != LineKind::Hit) {
            if matches!(access.kind, LineKind::Fetch | LineKind::Drain) {
                self.line(access, access.line);
            }
            if access.victim != LineAccess::NONE {
                self.line(access, access.victim);
            }
        }
    }

    fn line(&mut self, access: &LineAccess, line: u32) {
        let Some(client) = port(access.client) else { return };
        let place = self.map.place(line);
        let bank = place.channel * self.banks + place.bank;
        if std::mem::replace(&mut self.rows[bank][client], place.row) != place.row {
            self.busy[bank] += self.row;
        }
    }

    /// The busy time of the bank that is busy longest, since it was last asked for.
    pub fn take_longest(&mut self) -> Time {
        let longest = self.busy.iter().copied().max().unwrap_or(0);
        self.busy.fill(0);
        longest
    }
}
