fn main() {
    let mut a = std::env::args().skip(1);
    let path = a.next().unwrap(); let robot: u32 = a.next().unwrap().parse().unwrap();
    let (mut rec, _) = pleiad_recording::open(std::path::Path::new(&path), &Default::default()).unwrap();
    rec.robots.retain(|r, _| r.0 == robot);
    let t = std::time::Instant::now();
    let d = pleiad_mismatch::diagnose(&[rec], &Default::default()).unwrap();
    println!("{:?} {:?}", t.elapsed(), d.findings.verdict);
    for f in &d.findings.findings {
        println!("  {:?} {:?} {:?} set {:?} p {:.1e} gain {:.1} se {:.1} {} {:?}", f.verdict, f.robots, f.effect, f.support_set, f.p_familywise, f.held_out.log_score_gain, f.held_out.log_score_gain_se, f.channel, f.place);
        for (k, v) in &f.parameters { println!("      {k} {:.6} [{:.6} {:.6}]", v.value, v.ci95[0], v.ci95[1]); }
    }
    for n in &d.findings.notes { println!("   n {n}"); }
}
