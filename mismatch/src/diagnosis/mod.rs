//! The diagnosis: which effects of the catalogue a recording shows.

mod candidate;
mod chi_square;
mod entries;
mod fit;
mod noise;
mod parallel;
mod refine;
mod select;
mod starts;
mod term;
mod touch;
mod unit;
mod white;

/// Debug.
pub fn probe(recording: &pleiad_recording::Recording) {
    use unit::Unit;
    let models = crate::builtin::models(recording).unwrap();
    let evidence = crate::Evidence::new(recording, &models);
    let t = std::time::Instant::now();
    let units: Vec<Unit<'_>> = models.iter().map(|(&r, m)| {
        let f = floors(recording, r);
        Unit::new(&evidence, 0, r, m.clone(), f, recording.nominal.as_ref().map_or(0.0, |n| n.noise.command_jitter_s / 12f64.sqrt())) }).collect();
    let refs: Vec<&Unit<'_>> = units.iter().collect();
    println!("units {:?} rows {:?}", t.elapsed(), units.iter().map(|u| u.rows.len()).collect::<Vec<_>>());
    let entries = entries::entries(&refs);
    let selected = select::select(&refs, &entries.entries).unwrap();
    println!("selected {:?} tests {}", t.elapsed(), selected.tests);
    let cov = select::covariance(&refs, &selected.fit);
    for (i, term) in selected.fit.terms.iter().enumerate() {
        let ses: Vec<f64> = (0..selected.fit.slots.len()).filter(|&s| selected.fit.slots[s].0 == i).map(|s| cov.as_ref().map_or(f64::NAN, |c| c[(s, s)].sqrt())).collect();
        let rel: Vec<f64> = term.parameters().iter().map(|p| p.relevance.threshold(&units[0].floors)).collect();
        println!("  {:?} {} {:?} se {:?} rel {:?}", term.whose, term.effect.name(), term.values, ses, rel);
    }
}

fn floors(recording: &pleiad_recording::Recording, robot: pleiad_estimation::RobotId) -> pleiad_physics::Floors {
    let Some(n) = &recording.nominal else { return pleiad_physics::Floors::default() };
    pleiad_physics::Floors {
        lateral_slip_s: n.noise.odometry_floor_lateral_slip_s,
        sensor_lag_s: n.noise.gyro_floor_lag_s,
        command_lag_s: n.noise.command_floor_lag_s,
        servo_time_constant_s: n.robots.get(&robot).map_or(0.0, |r| r.servo_time_constant_s),
    }
}
