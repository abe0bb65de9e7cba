//! A bank of memory at the level `packet`: the rows that are open, one after another in time.

use super::Span;
use super::calendar::{Calendar, Turn};
use crate::clock::Time;

/// Lines of one group, all reads or all writes, that go over their bus one after another.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lines {
    pub first: u32,
    pub is_write: bool,
    pub count: u32,
    pub turn: Turn,
    /// When the first and the last enter the queue of the channel.
    pub seen: Span,
}

/// A row in use: from the line that opened it, or came to it after it had nothing to do, to the last line
/// that came meanwhile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct OpenRow {
    row: u32,
    /// Time of the first request.
    pub since: Time,
    /// When it is open.
    pub opened: Time,
    /// When its last line so far is issued, and when the chips let it close.
    until: Time,
    pub may_close: Time,
    /// When the next row begins to open.
    pub closes: Time,
    /// Time on the bus of lines that joined it.
    pub joined: Time,
}

impl OpenRow {
    pub const NONE: Self =
        Self { row: u32::MAX, since: 0, opened: 0, until: 0, may_close: 0, closes: 0, joined: 0 };
}

/// A bank: calendar of its row activations, and its latest rows, the newest first.
#[derive(Clone, Debug)]
pub(super) struct Bank {
    pub time: Calendar,
    pub rows: Box<[OpenRow]>,
    /// The latest row that was read and that was written, and lines of the channel up to then.
    kinds: [(u32, u64); 2],
}

/// Lines of one row in a bank.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowUse {
    pub row: u32,
    /// When they arrive, when the row is open, and when the last one is issued.
    pub seen: Time,
    pub opened: Time,
    pub issued: Time,
    /// When the chips let the row close.
    pub may_close: Time,
    /// Their time on the bus.
    pub work: Time,
}

impl Bank {
    /// A bank that remembers `rows` rows.
    pub fn new(time: Calendar, rows: usize) -> Self {
        Self { time, rows: vec![OpenRow::NONE; rows].into(), kinds: [(u32::MAX, 0); 2] }
    }

    /// When the row at a place is open for lines that join it and take `work` on the bus. Rows that are
    /// waiting already wait for these lines, too.
    pub fn join(&mut self, at: usize, lines: &Lines, work: Time) -> Time {
        let (open, seen) = (self.rows[at], lines.seen.from);
        if open.closes < Time::MAX {
            self.time.reserve_as(lines.turn, open.opened.max(seen), work);
        }
        // A row that is requested later in time, though earlier in the stream, does not keep the line waiting.
        if open.since <= seen { open.opened } else { seen }
    }

    /// Note lines of a kind and a row. Whether lines of the other kind, not far from them, are of another row.
    pub fn turns_rows(&mut self, kind: usize, row: u32, lines: u64, queue: u64) -> bool {
        self.kinds[kind] = (row, lines);
        let (other, last) = self.kinds[1 - kind];
        other != row && other != u32::MAX && lines - last < queue
    }

    /// The rows that open after that at place `at` do so later, as more lines of it go first.
    pub fn delay(&mut self, at: usize, by: Time) {
        for open in &mut self.rows[..at] {
            open.opened += by;
            open.closes = open.closes.saturating_add(by);
        }
        self.rows[at].closes += by;
    }

    /// Place of the latest row that was requested by `seen`, in time. Rows before it come later, though
    /// earlier in the stream.
    pub fn place(&self, seen: Time) -> usize {
        self.rows.iter().position(|open| open.since <= seen).unwrap_or(self.rows.len() - 1)
    }

    /// Place of the opening of `row` that a line joins which enters the queue at `seen`; `None` if it has to
    /// open its row.
    ///
    /// First ready first come (Rixner et al. 2000): a line joins pending lines of its row, ahead of older
    /// requests to other rows, until the row closes.
    pub fn joins(&self, row: u32, seen: Time) -> Option<usize> {
        let latest = self.place(seen);
        let is_open = |&at: &usize| self.rows[at].row == row && seen < self.closed_at(at);
        Some(latest).filter(|&at| self.rows[at].row == row).or_else(|| (0..self.rows.len()).find(is_open))
    }

    /// When the row at a place closes: once the chips let it and the next is requested, even if that can open
    /// only later.
    fn closed_at(&self, at: usize) -> Time {
        let open = &self.rows[at];
        let next = at.checked_sub(1).map_or(Time::MAX, |next| self.rows[next].since);
        open.closes.min(open.may_close.max(next))
    }

    /// Record lines of a row: those that joined the row at `joined`, or opened theirs.
    pub fn note(&mut self, used: RowUse, joined: Option<usize>) {
        let RowUse { row, seen, opened, issued, may_close, work } = used;
        let at = self.place(seen);
        let begins_anew = |open: &usize| *open == at && seen > self.rows[at].until;
        if let Some(open) = joined.filter(|open| !begins_anew(open)).map(|at| &mut self.rows[at]) {
            open.until = open.until.max(issued);
            open.may_close = open.may_close.max(may_close);
            open.joined += work;
            return;
        }
        let closes = at.checked_sub(1).map_or(Time::MAX, |next| self.rows[next].opened);
        let last = self.rows.len() - 1;
        self.rows.copy_within(at..last, at + 1);
        self.rows[at] = OpenRow { row, since: seen, opened, until: issued, may_close, closes, joined: 0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_joins_others_of_its_row_until_it_closes() {
        let used = |row, [seen, opened, issued]: [Time; 3]| RowUse {
            row,
            seen,
            opened,
            issued,
            may_close: issued,
            work: 1,
        };
        let mut bank = Bank::new(Calendar::new(16, 1), 4);
        let joins = |bank: &Bank, row, seen| bank.joins(row, seen).map(|at| bank.rows[at].opened);
        assert_eq!(joins(&bank, 7, 0), None);
        bank.note(used(7, [0, 4, 10]), None);
        assert_eq!((joins(&bank, 7, 50), joins(&bank, 8, 5)), (Some(4), None));
        // The next row is requested at 5. That of 7 may close at 10, long before the next can open.
        bank.rows[0].closes = 60;
        bank.note(used(8, [5, 64, 70]), None);
        assert_eq!([9, 10].map(|seen| joins(&bank, 7, seen)), [Some(4), None]);
        bank.note(used(7, [9, 4, 30]), Some(1));
        let rows = |bank: &Bank| [0, 1, 2].map(|at: usize| (bank.rows[at].row, bank.rows[at].until));
        assert_eq!(rows(&bank)[..2], [(8, 70), (7, 30)]);
        assert_eq!([29, 30].map(|seen| joins(&bank, 7, seen)), [Some(4), None]);
        // A row that comes earlier in time, and later in the stream.
        bank.note(used(9, [3, 12, 13]), None);
        assert_eq!((rows(&bank), bank.rows[1].closes), ([(8, 70), (9, 13), (7, 30)], 64));
    }

    #[test]
    fn a_row_that_is_used_again_later_keeps_no_line_waiting() {
        let used = |seen| RowUse { row: 7, seen, opened: 4, issued: seen + 6, may_close: seen + 6, work: 1 };
        let mut bank = Bank::new(Calendar::new(16, 1), 4);
        bank.note(used(0), None);
        // While lines of it wait, and then again.
        for seen in [5, 11, 500] {
            let joined = bank.joins(7, seen);
            assert_eq!(joined, Some(0));
            bank.note(used(seen), joined);
        }
        let at = |seen| bank.rows[bank.place(seen)];
        assert_eq!(
            [12, 400, 500].map(|seen| (at(seen).since, at(seen).may_close)),
            [(0, 17), (0, 17), (500, 506)]
        );
    }
}
