#![allow(clippy::all, clippy::pedantic, clippy::print_stdout, missing_docs)]
use pleiad_estimation::joint::ErrorForm;
use pleiad_estimation::slam::Association;
use pleiad_estimation::statistics::Alignment;
use pleiad_sim_peers::Scenario;
use pleiad_survey::slam::*;
fn main() {
    let scenario = Scenario::from_toml(SCENARIO, "slam.toml").unwrap();
    for seed in 101..104 {
        for luck in [Luck::None, Luck::Drawn] {
            let start = std::time::Instant::now();
            let input = SlamInput::simulated(&scenario, seed, luck).unwrap();
            println!("seed {seed} {luck:?} sim {:?}", start.elapsed());
            for (form, association, bearing, gate) in [
                (ErrorForm::Invariant, Association::Identity, false, 1.0),
                (ErrorForm::Additive, Association::Identity, false, 1.0),
                (ErrorForm::Invariant, Association::Nearest, false, 1.0),
                (ErrorForm::Invariant, Association::Nearest, false, 1000.0),
                (ErrorForm::Invariant, Association::Identity, true, 1.0),
                (ErrorForm::Invariant, Association::Nearest, true, 1.0),
            ] {
                let start = std::time::Instant::now();
                let options = RunOptions { form, association, without_ranges: bearing, gate_factor: gate, known: false };
                let mut watch = DeterminantWatch::new(seed);
                let mut last = None;
                let ran = run(&input, &options, |slam, time, births| {
                    let (ids, p) = covariance_at_truth(slam, births, &input.landmarks);
                    watch.take(&ids, &p);
                    if let Some(truth) = input.recorded.truth_at(time, 0.3) {
                        last = Some((per_dimension(&pose_error(slam, &truth)), seen_map_error(slam, &truth, births, &input.landmarks).and_then(|e| per_dimension(&e))));
                    }
                }).unwrap();
                println!("{form:?} {association:?} bearing {bearing} gate {gate}: {:?}", start.elapsed());
                println!("   map {} err {:?} aligned {:?} traj {:?} nis {:?} {:?} refused {} poses {}", ran.map.len(), ran.map_error_m(Alignment::None), ran.map_error_m(Alignment::Se2), ran.trajectory_error_m(Alignment::None), ran.mean_nis(), ran.associated, ran.refused, ran.most_waiting_poses);
                println!("   growth {:e} of {} singular {}; {:?} ; {:?} nees {last:?}", watch.largest_growth, watch.compared, watch.singular, likeness_of(&ran.slam), over_limit(&input, &ran.slam));
            }
        }
    }
}
