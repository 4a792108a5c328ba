use pleiad_physics::Effect;
use pleiad_tests::known_effects::{ROBOT, cases_of};
use pleiad_mismatch::fit_known;
use pleiad_sim_peers::simulate;
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let effect = Effect::from_name(&args[0]).unwrap();
    let (from, to): (u64, u64) = (args[1].parse().unwrap(), args[2].parse().unwrap());
    let mut case = cases_of(effect).pop().unwrap();
    for extra in &args[3..] {
        let (k, v) = extra.split_once('=').unwrap();
        let v: f64 = v.parse().unwrap();
        for s in case.scenario.robots.values_mut() {
            match k {
                "jitter" => s.command_jitter_s = v,
                "ticks" => s.encoder_ticks_per_rev = v as u32,
                "slip" => { s.odometry.noise.speed_m_per_sqrt_s = v; s.odometry.noise.lateral_m_per_sqrt_s = v; s.odometry.noise.yaw_rad_per_sqrt_s = v * 0.4; }
                _ => {}
            }
        }
        match k { "truth" => { case.scenario.truth_sigma_m = v; case.scenario.truth_sigma_rad = v; } "duration" => case.scenario.duration_s = v, _ => {} }
    }
    for seed in from..=to {
        let run = simulate(&case.scenario, seed).unwrap();
        let t = std::time::Instant::now();
        let fits = fit_known(&run.recording, ROBOT, &[effect]).unwrap();
        print!("{seed} {:.2}s", t.elapsed().as_secs_f64());
        for fit in &fits {
            for (p, truth) in fit.parameters.iter().zip(&case.values) {
                let z = p.standard_error.map(|s| (p.value - truth) / s);
                print!("  {} {:.6} ({:+.2e} se {:?} z {:+.2})", p.label, p.value, p.value - truth, p.standard_error.map(|s| format!("{s:.1e}")).unwrap_or_default(), z.unwrap_or(f64::NAN));
            }
        }
        println!();
    }
}
