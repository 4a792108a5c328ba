use pleiad_physics::{ActiveEffect, Effect};
use pleiad_estimation::RobotId;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let effect = Effect::from_name(&args[1]);
    let seeds: Vec<u64> = args[2].split(',').map(|s| s.parse().unwrap()).collect();
    let length: f64 = args.get(3).map_or(150.0, |s| s.parse().unwrap());
    let text = std::fs::read_to_string("scenarios/manoeuvres.toml").unwrap().replace("duration_s = 300.0", &format!("duration_s = {length:.1}"));
    for seed in seeds {
        let mut scenario = pleiad_sim_peers::Scenario::from_toml(&text, "manoeuvres.toml").unwrap();
        if let Some(effect) = effect {
            let values: Vec<f64> = args.get(4).map_or(effect.typical_values(), |s| s.split(',').map(|v| v.parse().unwrap()).collect());
            scenario.robots.get_mut(&RobotId(2)).unwrap().effects.push(ActiveEffect::new(effect, &values).unwrap());
        }
        let run = pleiad_sim_peers::simulate(&scenario, seed).unwrap();
        let t = std::time::Instant::now();
        let d = pleiad_mismatch::diagnose(&[run.recording], &Default::default()).unwrap();
        println!("== {} seed {seed} {:?} {:?}", args[1], t.elapsed(), d.findings.verdict);
        for f in &d.findings.findings {
            println!("  {:?} {:?} {:?} set {:?} p {:.1e} gain {:.1} se {:.1} {} {:?}", f.verdict, f.robots, f.effect, f.support_set, f.p_familywise, f.held_out.log_score_gain, f.held_out.log_score_gain_se, f.channel, f.place);
            for (k, v) in &f.parameters { println!("      {k} {:.6} [{:.6} {:.6}]", v.value, v.ci95[0], v.ci95[1]); }
        }
        for n in d.findings.notes.iter().filter(|n| !n.contains("windows") && !n.contains("recorded") && !n.contains(" around") && !n.contains("near")) { println!("   n {n}"); }
        if args.get(5).is_some() {
            for u in &d.findings.undetected { println!("   u {} {:?} {} {:.2e}", u.effect, u.robot, u.parameter, u.minimum_detectable); }
        }
    }
}
