//! The numbers that the paper states in its text and tables. Numbers that only its figures show are not included.

/// The numbers as a CSV file, which the plots read too. `at` is a number of modules, in "disconnected" the size of the
/// configurations, in "`case_studies`" the number of the case.
///
/// Sources: the text on Figures 6(a), 7(a) and 7(b), Table I ("No. of Modules Disconnected"), the captions of Figure 10.
pub(crate) const CSV: &str = include_str!("paper.csv");

/// One number that the paper states.
pub(crate) struct Stated {
    pub at: usize,
    pub value: f64,
    /// Per cent of the planning time, for completion.
    pub time_percent: f64,
}

/// The numbers that the paper states of one quantity of an experiment.
pub(crate) fn stated(experiment: &str, quantity: &str) -> Vec<Stated> {
    let rows = CSV.lines().map(|line| line.split(',').collect());
    rows.filter_map(|row: Vec<&str>| match row[..] {
        [of, at, what, value, _, time] if of == experiment && what == quantity => Some(Stated {
            at: at.parse().ok()?,
            value: value.parse().ok()?,
            time_percent: time.parse().unwrap_or(100.0),
        }),
        _ => None,
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_of_the_file_is_read() {
        let quantities = [
            ("messages", "pairs_delivered"),
            ("messages_50_spots", "pairs_delivered"),
            ("completion", "selected_percent"),
            ("completion_50_spots", "selected_percent"),
            ("disconnected", "planning_ms"),
            ("disconnected", "disconnected"),
            ("case_studies", "planning_ms"),
            ("case_studies", "disconnections"),
        ];
        let read = quantities.map(|(experiment, quantity)| stated(experiment, quantity).len());
        assert_eq!(read, [1, 1, 2, 2, 4, 4, 8, 8]);
        assert_eq!(read.iter().sum::<usize>() + 1, CSV.lines().count());
    }
}
