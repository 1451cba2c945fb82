use super::*;
use formation_model::DockingAction;

const OTHER: ModuleId = ModuleId(7);

fn at(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

fn pose(x: f64, theta: f64) -> Pose {
    Pose::from_units(x, 0.0, theta).unwrap()
}

fn goal(x: f64) -> MotionGoal {
    MotionGoal {
        pose: pose(x, 0.0),
        unit_distance: MicroUnits(0),
        pivot: None,
    }
}

fn drive() -> ExternalDrive {
    ExternalDrive::new(pose(0.0, 0.0), ExternalParameters::default(), 100)
}

fn reports(drive: &mut ExternalDrive) -> Vec<MotionReport> {
    std::iter::from_fn(|| drive.poll_report()).collect()
}

fn commands(drive: &mut ExternalDrive) -> Vec<DriveCommand> {
    std::iter::from_fn(|| drive.poll_command()).collect()
}

/// The reports but for those of where it is on its way.
fn ends(drive: &mut ExternalDrive) -> Vec<MotionReport> {
    let mut reports = reports(drive);
    reports.retain(|report| !matches!(report, MotionReport::Pose(_)));
    reports
}

fn faults(drive: &mut ExternalDrive) -> Vec<String> {
    std::iter::from_fn(|| drive.poll_fault())
        .map(|fault| fault.to_string())
        .collect()
}

#[test]
fn goals_go_out_each_time_and_arrival_is_judged_by_the_pose() {
    let mut drive = drive();
    for second in 0..3 {
        drive.go(at(second * 1_000), &goal(2.0));
    }
    assert_eq!(
        commands(&mut drive),
        [DriveCommand::Goal(goal(2.0).pose); 3]
    );
    drive.handle_pose(at(2_100), pose(1.0, 0.0));
    // Where it should be, but turned by more than the tolerance.
    drive.handle_pose(at(2_200), pose(2.0, 0.1));
    drive.handle_pose(at(2_300), pose(2.01, -0.02));
    assert_eq!(
        reports(&mut drive),
        [
            MotionReport::Pose(pose(1.0, 0.0)),
            MotionReport::Pose(pose(2.0, 0.1)),
            MotionReport::Arrived {
                goal: goal(2.0).pose,
                pose: pose(2.01, -0.02),
            },
        ]
    );
    // Noise of a standing module is not reported, but a displacement is.
    drive.handle_pose(at(9_000), pose(2.02, -0.02));
    drive.handle_pose(at(9_100), pose(2.5, -0.02));
    assert_eq!(reports(&mut drive), [MotionReport::Pose(pose(2.5, -0.02))]);
    assert_eq!(drive.poll_timeout(), None);
}

/// The agent would take each report for a displacement by another.
#[test]
fn poses_that_scatter_about_one_are_no_displacement_and_a_small_one_that_stays_is() {
    let mut drive = drive();
    let mut measure = |step: u64, x: f64, theta: f64| {
        drive.handle_pose(at(step * 50), pose(x, theta));
        reports(&mut drive)
    };
    for round in 0..20 {
        let first = round * 4;
        assert_eq!(measure(first, 0.012, -0.01), []);
        assert_eq!(measure(first + 1, -0.015, 0.02), []);
        assert_eq!(measure(first + 2, 0.025, 0.0), [], "once beyond 0.02");
        assert_eq!(measure(first + 3, -0.01, -0.035), [], "once beyond 0.03");
    }
    let mut moved = (80..100).flat_map(|step| measure(step, 0.03, 0.0));
    assert_eq!(moved.next(), Some(MotionReport::Pose(pose(0.03, 0.0))));
    assert_eq!(moved.next(), None);
}

/// Later poses are compared with the one that was reported last.
#[test]
fn a_halt_of_a_module_that_stands_reports_where_it_stands() {
    let mut drive = drive();
    drive.handle_pose(at(0), pose(0.015, 0.0));
    drive.halt(at(50));
    assert_eq!(
        reports(&mut drive),
        [MotionReport::Halted(pose(0.015, 0.0))]
    );
    // Within the tolerance of where it began, and not of where it was reported last.
    for step in 0..20 {
        drive.handle_pose(at(100 + step * 50), pose(-0.018, 0.0));
    }
    assert_eq!(reports(&mut drive), [MotionReport::Pose(pose(-0.018, 0.0))]);
}

#[test]
fn headings_are_compared_across_the_full_turn() {
    let drive = drive();
    assert!(drive.is_near(&pose(0.0, 3.13), &pose(0.0, -3.13)));
    assert!(!drive.is_near(&pose(0.0, 3.1), &pose(0.0, -3.1)));
}

#[test]
fn a_driver_that_falls_silent_on_the_way_has_failed() {
    let mut drive = drive();
    drive.go(at(1_000), &goal(2.0));
    assert_eq!(drive.poll_timeout(), Some(at(6_000)));
    drive.handle_pose(at(2_000), pose(0.5, 0.0));
    assert_eq!(drive.poll_timeout(), Some(at(7_000)));
    drive.advance(at(6_999));
    assert_eq!(faults(&mut drive), [""; 0]);
    drive.advance(at(7_000));
    assert_eq!(reports(&mut drive).last(), Some(&MotionReport::Failed));
    assert!(faults(&mut drive)[0].contains("pose_limit_s (5 s)"));
    // Where it stands is known when its driver says so.
    drive.halt(at(7_000));
    for (time, x) in [(8_000, 1.9), (8_100, 2.0), (8_300, 2.0), (8_700, 2.0)] {
        assert_eq!(ends(&mut drive), [], "{time}");
        drive.handle_pose(at(time), pose(x, 0.0));
    }
    assert_eq!(ends(&mut drive), [MotionReport::Halted(pose(2.0, 0.0))]);
    assert_eq!(drive.poll_timeout(), None);
}

#[test]
fn a_halt_is_reported_when_the_module_stands_still_and_not_before() {
    let mut drive = drive();
    drive.halt(at(0));
    assert_eq!(
        reports(&mut drive),
        [MotionReport::Halted(pose(0.0, 0.0))],
        "it never moved"
    );
    drive.go(at(0), &goal(5.0));
    drive.halt(at(1_000));
    for step in 0..10_u32 {
        drive.handle_pose(
            at(1_000 + u64::from(step) * 100),
            pose(f64::from(step) * 0.1, 0.0),
        );
    }
    assert_eq!(ends(&mut drive), [], "it still rolls");
    drive.handle_pose(at(2_000), pose(0.901, 0.0));
    drive.handle_pose(at(2_400), pose(0.9, 0.0));
    assert_eq!(ends(&mut drive), [MotionReport::Halted(pose(0.9, 0.0))]);
}

/// One pose in three is off by more than the tolerance, the mean of several is not.
#[test]
fn noise_does_not_keep_a_module_from_standing_still() {
    let mut drive = drive();
    drive.go(at(0), &goal(5.0));
    drive.halt(at(0));
    for step in 0..30_u32 {
        let off = [0.0, 0.04, -0.04][step as usize % 3];
        drive.handle_pose(at(u64::from(step) * 50), pose(1.0 + off, 0.0));
    }
    let ends = ends(&mut drive);
    assert!(matches!(ends[..], [MotionReport::Halted(_)]), "{ends:?}");
}

/// A driver goes on to its last goal for a while, and would do so from wherever it believes to be.
#[test]
fn a_driver_that_is_to_stand_gets_its_pose_as_the_goal_and_again_if_that_jumps() {
    let goals = |drive: &mut ExternalDrive| -> Vec<Pose> {
        let commands = commands(drive).into_iter();
        commands
            .map(|command| match command {
                DriveCommand::Goal(pose) => pose,
                DriveCommand::Docking(_) => panic!("{command:?}"),
            })
            .collect()
    };
    let mut halted = drive();
    halted.go(at(0), &goal(5.0));
    halted.handle_pose(at(100), pose(1.0, 0.0));
    halted.halt(at(100));
    assert_eq!(goals(&mut halted), [pose(5.0, 0.0), pose(1.0, 0.0)]);
    for (time, measured, held) in [(150, 1.03, 1.0), (200, -0.5, -0.5), (250, 1.0, 1.0)] {
        halted.handle_pose(at(time), pose(measured, 0.0));
        assert_eq!(goals(&mut halted), [pose(held, 0.0)], "{time}");
    }
    halted.handle_pose(at(2_300), pose(1.0, 0.0));
    assert_eq!(goals(&mut halted), [], "its last goal is too old");

    // The driver follows the goal that it got for a jump as long as any other.
    let mut late = drive();
    late.go(at(0), &goal(1.0));
    late.handle_pose(at(100), pose(1.0, 0.0));
    for (time, measured) in [(2_000, 3.0), (2_150, 1.0), (4_100, 3.0), (4_500, 1.0)] {
        goals(&mut late);
        late.handle_pose(at(time), pose(measured, 0.0));
        assert_eq!(goals(&mut late), [pose(measured, 0.0)], "{time}");
    }
    // While it halts, each goal counts that it gets.
    let mut halting = drive();
    halting.go(at(0), &goal(5.0));
    halting.handle_pose(at(100), pose(1.0, 0.0));
    halting.halt(at(100));
    halting.handle_pose(at(2_050), pose(1.01, 0.0));
    goals(&mut halting);
    halting.handle_pose(at(2_150), pose(1.01, 0.0));
    assert_eq!(
        goals(&mut halting),
        [],
        "what it followed before is too old"
    );
    halting.handle_pose(at(2_200), pose(3.0, 0.0));
    assert_eq!(
        goals(&mut halting),
        [pose(3.0, 0.0)],
        "it got the last one at 2.05 s"
    );

    let mut arrived = drive();
    arrived.go(at(0), &goal(1.0));
    arrived.handle_pose(at(100), pose(1.0, 0.0));
    assert_eq!(goals(&mut arrived), [pose(1.0, 0.0)]);
    arrived.handle_pose(at(150), pose(1.02, 0.0));
    assert_eq!(goals(&mut arrived), [], "it holds its goal by itself");
    arrived.handle_pose(at(200), pose(3.0, 0.0));
    assert_eq!(goals(&mut arrived), [pose(3.0, 0.0)]);
}

#[test]
fn a_module_that_cannot_be_stopped_has_failed_and_never_counts_as_halted() {
    let mut drive = drive();
    drive.go(at(0), &goal(5.0));
    drive.halt(at(0));
    for step in 1..300_u32 {
        let now = at(u64::from(step) * 100);
        drive.handle_pose(now, pose(f64::from(step), 0.0));
        drive.advance(now);
    }
    assert_eq!(ends(&mut drive), [MotionReport::Failed]);
    let found = faults(&mut drive);
    assert_eq!(found.len(), 1);
    assert!(found[0].contains("halt_limit_s (10 s)"), "{found:?}");
}

/// Many drivers state one covariance whatever they know, or none.
#[test]
fn a_deviation_counts_once_two_have_differed() {
    let mut drive = drive();
    let mut stated = |deviation: Option<i64>| {
        drive.handle_deviation(deviation.map(MicroUnits));
        reports(&mut drive)
    };
    for constant in [None, Some(90_000), Some(90_000), None, Some(90_000)] {
        assert_eq!(stated(constant), [], "{constant:?}");
    }
    let deviation = |micro_units| [MotionReport::Deviation(MicroUnits(micro_units))];
    assert_eq!(stated(Some(10_000)), deviation(10_000));
    assert_eq!(stated(Some(10_000)), []);
    assert_eq!(stated(Some(90_000)), deviation(90_000));
    assert_eq!(stated(None), deviation(0), "it states none any more");
}

fn answer(request: u64, outcome: Result<(), String>) -> DockingResult {
    DockingResult { request, outcome }
}

fn asked(request: u64, action: DockingAction) -> DriveCommand {
    DriveCommand::Docking(DockingRequest {
        request,
        action,
        other: OTHER,
    })
}

#[test]
fn docking_requests_go_out_one_after_another_and_repeat_until_answered() {
    let mut drive = drive();
    drive.ask(at(0), DockingAction::Undock, OTHER);
    drive.ask(at(0), DockingAction::Undock, OTHER);
    drive.ask(at(0), DockingAction::Dock, OTHER);
    assert_eq!(drive.poll_timeout(), Some(at(500)));
    drive.advance(at(500));
    assert_eq!(
        commands(&mut drive),
        [
            asked(100, DockingAction::Undock),
            asked(100, DockingAction::Undock)
        ]
    );
    drive.handle_docking_result(at(600), answer(101, Ok(())));
    assert_eq!(reports(&mut drive), [], "that request was not sent yet");
    drive.handle_docking_result(at(700), answer(100, Ok(())));
    drive.handle_docking_result(at(800), answer(100, Ok(())));
    drive.handle_docking_result(at(900), answer(101, Ok(())));
    assert_eq!(
        reports(&mut drive),
        [MotionReport::Undocked(OTHER), MotionReport::Docked(OTHER)]
    );
    assert_eq!(commands(&mut drive), [asked(101, DockingAction::Dock)]);
    assert_eq!(drive.poll_timeout(), None);
}

#[test]
fn a_driver_that_does_not_dock_or_cannot_has_failed() {
    let mut drive = drive();
    drive.ask(at(0), DockingAction::Dock, OTHER);
    drive.ask(at(0), DockingAction::Dock, ModuleId(8));
    drive.advance(at(30_000));
    assert_eq!(reports(&mut drive), [MotionReport::Failed]);
    assert_eq!(
        faults(&mut drive),
        ["its driver did not answer the request to dock to module 7 within docking_limit_s (30 s)"]
    );
    drive.ask(at(40_000), DockingAction::Undock, OTHER);
    drive.handle_docking_result(at(40_100), answer(102, Err("latch jammed".to_owned())));
    assert_eq!(reports(&mut drive), [MotionReport::Failed]);
    assert_eq!(
        faults(&mut drive),
        ["its driver cannot undock from module 7: latch jammed"]
    );
}
