use pleiad_physics::{ActiveEffect, Effect};
use pleiad_tests::known_effects::{ROBOT, cases_of};
use pleiad_mismatch::{Channel, Evidence, nominal_models, residuals_of};
use pleiad_sim_peers::simulate;
// scratch2 effect seed channel parameter values...
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let effect = Effect::from_name(&args[0]).unwrap();
    let seed: u64 = args[1].parse().unwrap();
    let channel = *Channel::ALL.iter().find(|c| c.name() == args[2]).unwrap();
    let parameter: usize = args[3].parse().unwrap();
    let case = cases_of(effect).pop().unwrap();
    let run = simulate(&case.scenario, seed).unwrap();
    let models = nominal_models(&run.recording).unwrap();
    let evidence = Evidence::new(&run.recording, &models);
    for v in &args[4..] {
        let mut values = case.values.clone();
        values[parameter] = v.parse().unwrap();
        let model = models[&ROBOT].clone().with(ActiveEffect::new(effect, &values).unwrap());
        let found = residuals_of(&evidence, ROBOT, &model, channel);
        let n = channel.components().len();
        print!("{v}:");
        for c in 0..n {
            let mut r: Vec<f64> = found.rows.iter().map(|row| row.values()[c]).collect();
            let rms = (r.iter().map(|x| x * x).sum::<f64>() / r.len() as f64).sqrt();
            r.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
            print!("  rms {rms:.6} median {:.6} 99% {:.6} max {:.5}", r[r.len() / 2].abs(), r[r.len() * 99 / 100].abs(), r[r.len() - 1].abs());
        }
        println!();
        if args.len() == 5 {
            let mut rows: Vec<_> = found.rows.iter().collect();
            rows.sort_by(|a, b| b.values()[0].abs().max(b.values()[n-1].abs()).total_cmp(&a.values()[0].abs().max(a.values()[n-1].abs())));
            for row in rows.iter().take(25) {
                println!("   t {:.3} {:?} v {:.3} w {:.3}", row.time_s, row.values(), row.regime.speed_m_s, row.regime.yaw_rate_rad_s);
            }
        }
    }
}
