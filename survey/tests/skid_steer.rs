//! The skid-steered robot's claims, with fewer runs than the command takes.

use pleiad_survey::StudyOptions;
use pleiad_survey::skid_steer::{self, Path, calibrate, relative_errors, usual_calibration};

#[test]
fn the_filter_is_better_than_odometry_and_fixes_do_not_hurt() {
    let study = skid_steer::run(&StudyOptions { seeds: Some(30), first_seed: 6000 }).unwrap();
    // Thirty runs bound the change of a mean square to some 30 %: of that claim the estimate alone is held here.
    for claim in study.claims.iter().filter(|claim| !claim.statement.contains("do not hurt")) {
        assert!(claim.holds, "{claim:?}");
    }
    let number = |name: &str| study.numbers[name].as_f64().unwrap();
    assert!(number("short_run_change_of_mean_square_percent") < 5.0);
    for path in Path::PUBLISHED {
        let key = path.words().replace(' ', "_");
        let [calibrated, filter] =
            ["calibrated", "ekf"].map(|method| number(&format!("{key}_{method}_percent")));
        assert!(filter < 0.3 * calibrated, "{key}: {filter} % and {calibrated} %");
    }
}

#[test]
fn more_calibration_runs_find_the_track_of_the_ground() {
    // The ground makes the track act 10 % wider, with a spread of 12 % from run to run and 8 % from turn to turn: 13.3 %
    // a run and 1.5 % over 80. The sum of the angles weighs narrow tracks more, which lowers it by the square of the
    // spread, 1.8 %. Four standard errors.
    let effective = calibrate(1 << 41, 80).unwrap();
    let expected = 0.64 * 1.10 * (1.0 - 0.018);
    let off = effective.drive.track_width_m / expected - 1.0;
    assert!(off.abs() < 0.06, "{effective:?}");
    assert!((effective.drive.wheel_radius_m / (0.11 * 0.97) - 1.0).abs() < 0.01, "{effective:?}");
}

#[test]
fn a_calibration_for_another_robot_is_worse_than_none() {
    // The planted fault: the track of a narrower robot, with which a quarter turn becomes a third of a turn. (Half the
    // track would turn round at each corner, and come home by luck.)
    let sound = usual_calibration().unwrap();
    let mut wrong = sound;
    wrong.drive.track_width_m *= 0.75;
    let mean = |calibration| {
        let errors = (6100..6110).map(|seed| relative_errors(Path::Square, seed, calibration).unwrap());
        let (raw, calibrated) = errors.fold((0.0, 0.0), |sum, own| (sum.0 + own[0], sum.1 + own[1]));
        (raw / 10.0, calibrated / 10.0)
    };
    let (raw, spoiled) = mean(&wrong);
    assert!(spoiled > raw, "{spoiled} % and {raw} %");
}
