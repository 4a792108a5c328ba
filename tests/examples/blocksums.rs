use pleiad_physics::{ActiveEffect, Effect};
use pleiad_tests::known_effects::{ROBOT, cases_of};
use pleiad_mismatch::{Channel, Evidence, nominal_models, residuals_of};
use pleiad_sim_peers::simulate;
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let effect = Effect::from_name(&args[0]).unwrap();
    let channel = *Channel::ALL.iter().find(|c| c.name() == args[1]).unwrap();
    let parameter: usize = args[2].parse().unwrap();
    let (from, to): (u64, u64) = (args[3].parse().unwrap(), args[4].parse().unwrap());
    let lengths = [0.2, 1.0, 2.5, 5.0, 10.0, 20.0, 40.0];
    let mut z2 = vec![0.0; lengths.len()];
    let mut count = 0.0;
    for seed in from..=to {
        let case = cases_of(effect).pop().unwrap();
        let run = simulate(&case.scenario, seed).unwrap();
        let models = nominal_models(&run.recording).unwrap();
        let evidence = Evidence::new(&run.recording, &models);
        let h = 1e-5;
        let at = |shift: f64| {
            let mut values = case.values.clone();
            values[parameter] += shift;
            let model = models[&ROBOT].clone().with(ActiveEffect::new(effect, &values).unwrap());
            residuals_of(&evidence, ROBOT, &model, channel).rows
        };
        let (rows, up, down) = (at(0.0), at(h), at(-h));
        let n = channel.components().len();
        let jitter = 0.004 * 0.2886751;
        let mut scores: Vec<(f64, f64)> = Vec::new();
        let mut info = 0.0;
        for c in 0..n {
            let mut calm: Vec<f64> = rows.iter().filter(|r| r.du_squared()[c] == 0.0).map(|r| f64::abs(r.values()[c])).collect();
            calm.sort_by(f64::total_cmp);
            let keep = calm.len() * 97 / 100;
            let scale2 = calm.iter().take(keep).map(|x| x * x).sum::<f64>() / keep as f64;
            for (i, row) in rows.iter().enumerate() {
                let var = scale2 + row.du_squared()[c] * jitter * jitter;
                let x = (up[i].values()[c] - down[i].values()[c]) / (2.0 * h);
                scores.push((row.time_s, x * row.values()[c] / var));
                info += x * x / var;
            }
        }
        let sum: f64 = scores.iter().map(|s| s.1).sum();
        print!("{seed} est err {:+.2e} naive se {:.2e} z naive {:+.2}", -sum / info, 1.0 / info.sqrt(), -sum / info.sqrt());
        for (k, length) in lengths.iter().enumerate() {
            let mut blocks = std::collections::BTreeMap::new();
            for (t, s) in &scores { *blocks.entry((t / length) as i64).or_insert(0.0) += s; }
            let b: f64 = blocks.values().map(|s: &f64| s * s).sum();
            print!("  {length}: {:+.2}", sum / b.sqrt());
            z2[k] += sum * sum / b;
        }
        println!();
        if from == to {
            scores.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
            for (t, s) in scores.iter().take(20) { println!("   {t:.2} {:.3}", s / info.sqrt()); }
        }
        count += 1.0;
    }
    for (l, z) in lengths.iter().zip(&z2) { print!("{l}: {:.2}  ", z / count); }
    println!();
}
