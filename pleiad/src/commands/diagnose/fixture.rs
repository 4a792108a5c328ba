//! Findings made by hand, for tests.

use std::collections::BTreeMap;

use pleiad_mismatch::{
    Estimate, Finding, Findings, HeldOut, Place, RobotRollOuts, RollOut, Undetected, Untestable, Verdict,
};

/// A named finding of robot 2 with these parameters: name, value, interval, unit.
pub fn finding(effect: &str, parameters: &[(&str, f64, [f64; 2], &str)]) -> Finding {
    let estimate = |(name, value, ci95, unit): &(&str, f64, [f64; 2], &str)| {
        ((*name).to_owned(), Estimate { value: *value, unit: (*unit).to_owned(), ci95: *ci95 })
    };
    Finding {
        verdict: Verdict::Named,
        robots: vec![2],
        stage: "wheel".into(),
        channel: "body".into(),
        effect: Some(effect.into()),
        expression: None,
        expression_units: None,
        support_set: vec![effect.into()],
        parameters: parameters.iter().map(estimate).collect::<BTreeMap<_, _>>(),
        place: Place::default(),
        p_familywise: 1e-6,
        held_out: HeldOut { log_score_gain: 40.0, log_score_gain_se: 5.0, rollout_rmse: Vec::new() },
        shape: None,
        manoeuvre: None,
        summary: String::new(),
        equation: None,
        configuration: String::new(),
    }
}

/// Two findings, one of them of two rivals, and something of everything else.
pub fn findings() -> Findings {
    let horizon = RollOut {
        horizon_s: 5.0,
        nominal: 0.05,
        refit: 0.04,
        corrected: 0.01,
        heading_rad: [0.02, 0.02, f64::NAN],
    };
    Findings {
        verdict: Verdict::Named,
        recordings: vec!["square".into()],
        fit_on: vec!["square".into()],
        test_on: Vec::new(),
        findings: vec![
            finding("unequal_wheel_radii", &[("ratio", 0.01, [0.0097, 0.0103], "1")]),
            Finding {
                verdict: Verdict::CannotTell,
                robots: vec![1],
                stage: "actuator".into(),
                support_set: vec!["command_delay".into(), "actuator_lag".into()],
                manoeuvre: Some("steps of speed, 30 s".into()),
                ..finding("command_delay", &[("delay_s", 0.05, [0.04, 0.06], "s")])
            },
        ],
        undetected: vec![Undetected {
            effect: "gyro_scale".into(),
            robot: Some(1),
            parameter: "relative".into(),
            minimum_detectable: f64::INFINITY,
            unit: "1".into(),
        }],
        untestable: vec![Untestable {
            effect: "steer_trim".into(),
            robot: None,
            why: "no steering angle was recorded".into(),
        }],
        roll_outs: vec![RobotRollOuts { robot: 2, horizons: vec![horizon], error_per_100_m: [3.0, 0.4] }],
        notes: vec!["square: ends early".into()],
    }
}
