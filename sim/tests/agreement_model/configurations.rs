//! The parts of the rule that are searched apart, as everything at once is too much.

use super::rule::Rule;
use super::state::Budget;
use super::{Agreement, LeaseFrom, Network, Search, Times};

const NOTHING: Budget = Budget {
    rosters: 2,
    crashes: 0,
    losses: 0,
    removals: 0,
    false_removals: 0,
    blind: 0,
    link_changes: 0,
    sleeps: 0,
    rejoins: 0,
};

/// Clocks, delays and drives as bad as they may be.
const FULL: Times = Times {
    lease: 2,
    margin: 1,
    stop: 1,
    suspicion: 2,
    delay: 0,
};

/// The same with a lease of one tick.
const SHORT: Times = Times { lease: 1, ..FULL };

/// The shortest, where the question is who may form a roster, not when it may move.
const QUICK: Times = Times {
    lease: 1,
    margin: 0,
    stop: 0,
    suspicion: 1,
    delay: 0,
};

/// Three voters, of whose heartbeats any may be lost: leases, margins and drives.
pub fn heartbeats() -> Agreement {
    Agreement {
        rule: Rule::Right,
        modules: 3,
        voters: 0b111,
        files: 0,
        times: FULL,
        lease_from: LeaseFrom::Roster,
        network: Network::Lossy,
        budget: NOTHING,
        search: Search::Safety,
        one_by_one: true,
        sorts: true,
        has_speeds: false,
    }
}

/// Any of these with two rosters.
pub fn two_rosters(model: Agreement) -> Agreement {
    let budget = Budget {
        rosters: 2,
        ..model.budget
    };
    Agreement { budget, ..model }
}

/// As in `heartbeats`, with a short lease that counts from agreement.
pub fn lease_from_agreement() -> Agreement {
    Agreement {
        times: SHORT,
        lease_from: LeaseFrom::Agreement,
        ..heartbeats()
    }
}

/// As in `heartbeats`, with a short lease and a crash without a file.
pub fn lossy_crash() -> Agreement {
    Agreement {
        times: SHORT,
        budget: Budget {
            crashes: 1,
            ..NOTHING
        },
        ..heartbeats()
    }
}

/// Three voters with slow and fast clocks in any mixture, three rosters, and a cut or one-way links.
pub fn clocks() -> Agreement {
    Agreement {
        network: Network::Links,
        has_speeds: true,
        budget: Budget {
            rosters: 3,
            link_changes: 1,
            ..NOTHING
        },
        ..heartbeats()
    }
}

/// Three voters and a module that has no vote, a crash, and a cut or one-way links.
pub fn links() -> Agreement {
    Agreement {
        network: Network::Links,
        modules: 4,
        one_by_one: false,
        budget: Budget {
            link_changes: 1,
            crashes: 1,
            ..NOTHING
        },
        ..heartbeats()
    }
}

/// Two voters and a module that has no vote, crashes without files, and three rosters: rule 3.
pub fn idle() -> Agreement {
    Agreement {
        network: Network::Links,
        voters: 0b011,
        budget: Budget {
            rosters: 3,
            crashes: 2,
            ..NOTHING
        },
        ..heartbeats()
    }
}

/// The same with files and a truthful removal, and two rosters: the last clause of rule 3.
pub fn idle_with_removal() -> Agreement {
    Agreement {
        files: 0b111,
        times: SHORT,
        budget: Budget {
            crashes: 1,
            removals: 1,
            ..NOTHING
        },
        ..idle()
    }
}

/// As in `idle`, with a process that begins a new run: rosters that all who moved last follow.
pub fn rejoining() -> Agreement {
    Agreement {
        times: SHORT,
        budget: Budget {
            crashes: 1,
            rejoins: 1,
            ..idle().budget
        },
        ..idle()
    }
}

/// The same with two new runs, and a cut or one-way links.
pub fn rejoining_apart() -> Agreement {
    Agreement {
        budget: Budget {
            rejoins: 2,
            link_changes: 1,
            ..rejoining().budget
        },
        ..rejoining()
    }
}

/// Three voters that crash three times and lose two files, and four rosters: rule 5.
pub fn files() -> Agreement {
    Agreement {
        network: Network::Links,
        files: 0b111,
        times: QUICK,
        budget: Budget {
            rosters: 4,
            crashes: 3,
            losses: 2,
            ..NOTHING
        },
        ..heartbeats()
    }
}

/// The same without files.
pub fn no_files() -> Agreement {
    Agreement {
        files: 0,
        budget: Budget {
            losses: 0,
            ..files().budget
        },
        ..files()
    }
}

/// Four voters, a truthful removal, a crash and restart, and three rosters: rule 6.
pub fn removal() -> Agreement {
    Agreement {
        network: Network::Links,
        modules: 4,
        voters: 0b1111,
        files: 0b1111,
        times: QUICK,
        one_by_one: false,
        budget: Budget {
            rosters: 3,
            crashes: 1,
            removals: 1,
            ..NOTHING
        },
        ..heartbeats()
    }
}

/// The same with two crashes and two removals, and two rosters.
pub fn two_removals() -> Agreement {
    Agreement {
        budget: Budget {
            rosters: 2,
            crashes: 2,
            removals: 2,
            ..NOTHING
        },
        ..removal()
    }
}

/// Three voters and two truthful removals, so that one voter remains; members show digests one by one.
pub fn one_remains() -> Agreement {
    Agreement {
        modules: 3,
        voters: 0b111,
        files: 0b111,
        one_by_one: true,
        ..two_removals()
    }
}

/// Voters, one of which is removed although its run goes on behind a cut.
pub fn false_removal(voters: usize) -> Agreement {
    let all = (1 << voters) - 1;
    let (removals, false_removals) = (1, 1);
    Agreement {
        modules: voters,
        voters: all,
        files: all,
        one_by_one: voters < 4,
        budget: Budget {
            rosters: 3,
            removals,
            false_removals,
            link_changes: 1,
            ..NOTHING
        },
        ..removal()
    }
}

/// Three voters, a cut or one-way links, and a command that removes all that are silent.
pub fn blind() -> Agreement {
    Agreement {
        budget: Budget {
            rosters: 2,
            blind: 1,
            link_changes: 1,
            ..NOTHING
        },
        ..one_remains()
    }
}

/// Three voters that sleep, and heartbeats that are lost or up to two ticks late: rule 7.
pub fn sleep() -> Agreement {
    Agreement {
        times: Times {
            stop: 0,
            delay: 2,
            ..SHORT
        },
        budget: Budget {
            sleeps: 3,
            ..NOTHING
        },
        ..heartbeats()
    }
}

/// Five voters, two crashes, two truthful removals, and two rosters.
pub fn five_voters() -> Agreement {
    Agreement {
        modules: 5,
        voters: 0b1_1111,
        files: 0b1_1111,
        ..two_removals()
    }
}

/// Three voters with files, of which one is lost, and a crash, a removal that may be false, and a cut at once.
pub fn everything() -> Agreement {
    let all = Budget {
        crashes: 2,
        losses: 1,
        removals: 1,
        false_removals: 1,
        link_changes: 1,
        ..NOTHING
    };
    Agreement {
        one_by_one: false,
        budget: all,
        ..one_remains()
    }
}

/// Four voters without files, a truthful removal, two crashes, and three rosters.
pub fn removal_without_files() -> Agreement {
    let budget = Budget {
        crashes: 2,
        ..removal().budget
    };
    Agreement {
        files: 0,
        budget,
        ..removal()
    }
}

/// Four voters without files, a removal that may be false, a crash, and three rosters.
pub fn false_removal_without_files() -> Agreement {
    let budget = Budget {
        crashes: 1,
        false_removals: 1,
        ..removal().budget
    };
    Agreement {
        files: 0,
        budget,
        ..removal()
    }
}

/// Three voters and a module that has no vote, which show digests one by one, a crash, and links that change twice.
pub fn one_by_one() -> Agreement {
    let budget = Budget {
        link_changes: 2,
        crashes: 1,
        ..NOTHING
    };
    Agreement {
        times: SHORT,
        one_by_one: true,
        budget,
        ..links()
    }
}

/// As in `sleep`, with a longer lease and drives that stop late.
pub fn long_sleep() -> Agreement {
    let times = Times { delay: 2, ..FULL };
    let budget = Budget {
        sleeps: 4,
        ..NOTHING
    };
    Agreement {
        times,
        budget,
        ..heartbeats()
    }
}
