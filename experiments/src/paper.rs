//! The numbers that the paper states in its text and tables. Its figures give others, which were not read off.

/// One row of the paper's table: all initial configurations have one size, 100 modules, 100 spots.
pub(crate) struct DisconnectedRow {
    pub size: usize,
    /// Mean and standard deviation in milliseconds.
    pub planning_ms: (f64, f64),
    /// Mean and standard deviation of the "No. of Modules Disconnected".
    pub disconnected: (f64, f64),
}

/// Table I.
pub(crate) const DISCONNECTED: [DisconnectedRow; 4] = [
    DisconnectedRow {
        size: 10,
        planning_ms: (171.48, 15.13),
        disconnected: (0.12, 0.32),
    },
    DisconnectedRow {
        size: 20,
        planning_ms: (166.66, 12.88),
        disconnected: (4.32, 3.56),
    },
    DisconnectedRow {
        size: 25,
        planning_ms: (172.10, 11.30),
        disconnected: (8.76, 4.85),
    },
    DisconnectedRow {
        size: 50,
        planning_ms: (218.28, 19.57),
        disconnected: (29.68, 5.33),
    },
];

/// The text on Figure 7(b): messages of 100 modules with 100 spots, and with 50.
pub(crate) const MESSAGES_100_SPOTS: f64 = 10.0e5;
pub(crate) const MESSAGES_50_SPOTS: f64 = 8.0e5;

/// The text on Figure 6(a): number of modules, per cent of the time, per cent of the planning completed.
pub(crate) const COMPLETION: [(usize, f64, f64); 2] = [(10, 70.0, 30.0), (100, 25.0, 30.0)];

/// The text on Figure 7(a), 50 spots: the same.
pub(crate) const COMPLETION_50_SPOTS: [(usize, f64, f64); 2] =
    [(50, 100.0, 100.0), (100, 50.0, 100.0)];

/// Figure 10, captions of its cases: planning time in milliseconds, number of disconnections.
pub(crate) const CASES: [(f64, usize); 8] = [
    (110.0, 1),
    (113.0, 2),
    (111.0, 1),
    (170.0, 4),
    (182.0, 3),
    (173.0, 3),
    (190.0, 2),
    (184.0, 4),
];
