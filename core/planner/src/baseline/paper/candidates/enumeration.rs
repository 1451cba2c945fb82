//! The sets of spots that carry an embedding, one after another in their order.
//!
//! A binary search over the spots in ascending order, that enters a branch only if a candidate lies in it: first with the
//! spot, then without it. An oracle says so, and names a candidate as its witness, which saves the questions on which the
//! witness already gives the answer.

use fixedbitset::FixedBitSet;

/// What is decided about a spot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mark {
    /// Candidates may have the spot or not.
    Open,
    /// Candidates must have the spot.
    Chosen,
    /// Candidates must not have the spot.
    Excluded,
}

/// Answers for the candidates whose most valuable spot is one spot, the top.
pub(super) trait Oracle {
    /// A candidate with all spots that are chosen, the top among them, and without those excluded; `None` if there is
    /// none. `marks` has a mark for each spot.
    fn complete(&mut self, marks: &[Mark]) -> Option<FixedBitSet>;
}

/// Makes an oracle for each top.
pub(super) trait Oracles {
    /// The oracle of the candidates with this top.
    type Oracle<'s>: Oracle
    where
        Self: 's;

    /// The oracle for a top; what `marks` excludes stays excluded.
    fn oracle<'s>(&'s self, top: usize, marks: &[Mark]) -> Self::Oracle<'s>;
}

/// All candidates in order, each with its top: the lowest of its most valuable spots.
pub(super) struct Enumeration<'a, S: Oracles + 'a> {
    oracles: &'a S,
    size: usize,
    /// The spots of equal value that are still to be tops, the greatest value last.
    classes: Vec<Vec<usize>>,
    marks: Vec<Mark>,
    /// The candidates by top, for the tops of one value.
    streams: Vec<Stream<S::Oracle<'a>>>,
}

impl<'a, S: Oracles> Enumeration<'a, S> {
    /// `classes` has the spots of equal value together, greater values first; `size` is the number of spots of a candidate.
    pub(super) fn new(oracles: &'a S, mut classes: Vec<Vec<usize>>, size: usize) -> Self {
        let spot_count = classes.iter().map(Vec::len).sum();
        classes.reverse();
        Self {
            oracles,
            size,
            classes,
            marks: vec![Mark::Open; spot_count],
            streams: Vec::new(),
        }
    }

    /// Begins with the tops of the next lower value. A candidate with several of them belongs to the lowest.
    fn open_class(&mut self) -> bool {
        let Some(tops) = self.classes.pop() else {
            return false;
        };
        for top in tops {
            self.marks[top] = Mark::Chosen;
            let oracle = self.oracles.oracle(top, &self.marks);
            let stream = Stream::begin(oracle, top, self.marks.clone(), self.size);
            self.streams.extend(stream);
            self.marks[top] = Mark::Excluded;
        }
        true
    }
}

impl<S: Oracles> Iterator for Enumeration<'_, S> {
    type Item = (usize, Vec<usize>);

    fn next(&mut self) -> Option<Self::Item> {
        while self.streams.is_empty() {
            if !self.open_class() {
                return None;
            }
        }
        let numbered = self.streams.iter().enumerate();
        let (first, stream) = numbered.min_by(|one, other| one.1.head.cmp(&other.1.head))?;
        let candidate = (stream.top, stream.head.clone());
        if !self.streams[first].advance() {
            self.streams.remove(first);
        }
        Some(candidate)
    }
}

/// A decision of the search on the way to a candidate.
enum Decision {
    /// With the spot; if known, a candidate for the branch without it.
    With(usize, Option<FixedBitSet>),
    /// Without the spot; the branch with it is done.
    Without(usize),
}

/// The candidates with one top, in order.
struct Stream<O> {
    oracle: O,
    top: usize,
    size: usize,
    marks: Vec<Mark>,
    decisions: Vec<Decision>,
    chosen: usize,
    /// A candidate that agrees with all decisions.
    witness: FixedBitSet,
    /// The candidate to be listed next.
    head: Vec<usize>,
}

impl<O: Oracle> Stream<O> {
    /// `None` if there is no candidate with this top.
    fn begin(mut oracle: O, top: usize, marks: Vec<Mark>, size: usize) -> Option<Self> {
        let witness = oracle.complete(&marks)?;
        let mut stream = Self {
            oracle,
            top,
            size,
            marks,
            decisions: Vec::new(),
            chosen: 1,
            witness,
            head: Vec::new(),
        };
        stream.descend(0);
        Some(stream)
    }

    /// Finds the next candidate; false if there is none.
    fn advance(&mut self) -> bool {
        while let Some(decision) = self.decisions.pop() {
            match decision {
                Decision::Without(spot) => self.marks[spot] = Mark::Open,
                Decision::With(spot, known) => {
                    self.chosen -= 1;
                    self.marks[spot] = Mark::Excluded;
                    if let Some(witness) = known.or_else(|| self.oracle.complete(&self.marks)) {
                        self.witness = witness;
                        self.decisions.push(Decision::Without(spot));
                        self.descend(spot + 1);
                        return true;
                    }
                    self.marks[spot] = Mark::Open;
                }
            }
        }
        false
    }

    /// Decides the spots from `spot` on, each for the branch with it if a candidate lies there.
    fn descend(&mut self, mut spot: usize) {
        while self.chosen < self.size && spot < self.marks.len() {
            if self.marks[spot] == Mark::Open {
                self.decide(spot);
            }
            spot += 1;
        }
        self.head = self.witness.ones().collect();
        debug_assert_eq!(self.head.len(), self.size, "a witness is a candidate");
    }

    fn decide(&mut self, spot: usize) {
        self.marks[spot] = Mark::Chosen;
        let decision = if self.witness.contains(spot) {
            Decision::With(spot, None)
        } else if let Some(witness) = self.oracle.complete(&self.marks) {
            let without = std::mem::replace(&mut self.witness, witness);
            Decision::With(spot, Some(without))
        } else {
            self.marks[spot] = Mark::Excluded;
            Decision::Without(spot)
        };
        self.chosen += usize::from(matches!(decision, Decision::With(..)));
        self.decisions.push(decision);
    }
}
