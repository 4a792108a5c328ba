#![allow(clippy::all, clippy::pedantic, clippy::print_stdout, missing_docs)]
use pleiad_estimation::fact::Noise;
use pleiad_estimation::joint::ErrorForm;
use pleiad_estimation::motion::*;
use pleiad_estimation::sample::*;
use pleiad_estimation::slam::Association;
use pleiad_estimation::strategy::Noises;
use pleiad_estimation::symmetric::Symmetric3;
use pleiad_survey::slam::*;
fn main() {
    for dataset in [2, 6] {
        let path = format!("/work/shared/recordings/mrclam/MRCLAM_Dataset{dataset}");
        let (recording, _) = pleiad_recording::open(std::path::Path::new(&path), &Default::default()).unwrap();
        let (first, last) = recording.common_time().unwrap();
        for seconds in [600.0, 1e9] {
            let part = recording.slice(first, first.plus_seconds(seconds).min(last));
            let inputs: Vec<SlamInput> = part.robots.iter().map(|(robot, own)| {
                let (at, start) = own.odometry.iter().find_map(|s| Some((s.time, own.truth_at(s.time, 0.3)?))).unwrap();
                SlamInput {
                    robot: *robot,
                    motion: MotionModel { drive: None, noise: MotionNoise { forward_m_per_sqrt_s: 0.036, yaw_rad_per_sqrt_s: 0.15, quiet_at_standstill: true, ..Default::default() }, yaw: YawSource::Odometry, gyro_bias_rad_s: 0.0 },
                    noises: Noises { range_bearing: Some(Noise::from_sigmas(&[0.12, 0.04])), ..Default::default() },
                    start, start_noise: Symmetric3::diagonal(4e-4, 4e-4, 4e-4),
                    samples: own.samples().into_iter().filter(|s| s.time >= at && !matches!(s.reading, Reading::Sighting { target: Target::Robot(_), .. })).collect(),
                    recorded: own.clone(),
                    landmarks: part.landmarks.clone(),
                }
            }).collect();
            for (form, association, without_ranges) in [(ErrorForm::Invariant, Association::Identity, false), (ErrorForm::Additive, Association::Identity, false), (ErrorForm::Invariant, Association::Nearest, false), (ErrorForm::Invariant, Association::Identity, true), (ErrorForm::Invariant, Association::Nearest, true)] {
                let page = on_recording("x", &inputs, &RunOptions { form, association, without_ranges, ..Default::default() }).unwrap();
                println!("dataset {dataset} {seconds} {form:?} {association:?} bearing {without_ranges}\n{}", page.text);
            }
        }
    }
}
