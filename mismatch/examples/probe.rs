fn main() {
    for path in std::env::args().skip(1) {
        println!("== {path}");
        let t = std::time::Instant::now();
        let (rec, _) = pleiad_recording::open(std::path::Path::new(&path), &Default::default()).unwrap();
        let d = pleiad_mismatch::diagnose(&[rec], &Default::default()).unwrap();
        println!("{:?} {:?}", t.elapsed(), d.findings.verdict);
        for f in &d.findings.findings {
            println!(
                "  {:?} {:?} {:?} set {:?} p {:.1e} gain {:.1} se {:.1} {} {:?}",
                f.verdict,
                f.robots,
                f.effect,
                f.support_set,
                f.p_familywise,
                f.held_out.log_score_gain,
                f.held_out.log_score_gain_se,
                f.channel,
                f.place
            );
            for (k, v) in &f.parameters {
                println!("      {k} {:.6} [{:.6} {:.6}]", v.value, v.ci95[0], v.ci95[1]);
            }
            for r in &f.held_out.rollout_rmse {
                println!("      {} {:.4} {:.4} {:.4}", r.horizon_s, r.nominal, r.refit, r.corrected);
            }
        }
        for n in &d.findings.notes {
            println!("   n {n}");
        }
    }
}
