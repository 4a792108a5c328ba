use super::*;

#[test]
fn scores_in_closed_form_are_central_differences() {
    let row = |kind, range_m, yaw_rate_rad_s, errors, others, choices| Row {
        kind,
        range_m,
        yaw_rate_rad_s,
        errors,
        others,
        choices,
        time_s: 0.0,
        speed_m_s: 0.0,
        target: 0,
    };
    let rows = vec![
        row(0, 2.0, 0.3, [Some(0.04), Some(-0.01)], vec![[Some(0.5), Some(0.02)]], 2),
        row(0, 4.0, -1.2, [Some(0.4), Some(0.05)], vec![[Some(-0.03), Some(0.0)], [Some(0.1), Some(0.1)]], 3),
        row(1, 1.0, 0.0, [None, Some(0.03)], vec![], 1),
        row(1, 3.0, 0.7, [Some(-0.2), None], vec![], 0),
        // A sigma that shrinks with range is held at its least.
        row(1, 90.0, 0.7, [Some(0.001), Some(0.01)], vec![], 0),
    ];
    let blocks = vec![0; rows.len()];
    let sightings = Sightings { rows, blocks, kept: 0.5 };
    let free: Vec<usize> = (0..9).collect();
    for tails in [0.0, 0.2] {
        let mut parameters = vec![-3.0, -4.0, -2.5, -3.5, 0.004, -0.0012, 0.01, tails, -2.0];
        let scores = sightings.scores(&parameters, &free);
        for &index in &free {
            let Some(scores) = &scores[index] else {
                assert_eq!(index, TAILS);
                continue;
            };
            let h = 1e-6;
            let (value, mut at) = (parameters[index], [vec![0.0; 5], vec![0.0; 5]]);
            for (into, sign) in at.iter_mut().zip([1.0, -1.0]) {
                parameters[index] = value + sign * h;
                sightings.fill(&parameters, into);
            }
            parameters[index] = value;
            for row in 0..5 {
                let expected = (at[0][row] - at[1][row]) / (2.0 * h);
                let found = scores[row];
                assert!(
                    (found - expected).abs() < 1e-5 * expected.abs().max(1.0),
                    "{index} {row} {found} {expected}"
                );
            }
        }
    }
}
