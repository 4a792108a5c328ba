use pleiad_physics::{ActiveEffect, Effect};
use pleiad_estimation::{RobotId, sample::*};
fn main() {
    let text = std::fs::read_to_string("scenarios/manoeuvres.toml").unwrap();
    let run0; let run1;
    {
        let scenario = pleiad_sim_peers::Scenario::from_toml(&text, "m").unwrap();
        run0 = pleiad_sim_peers::simulate(&scenario, 11).unwrap();
        let mut s = scenario.clone();
        s.robots.get_mut(&RobotId(2)).unwrap().effects.push(ActiveEffect::new(Effect::IdentityMixUp, &[0.02]).unwrap());
        run1 = pleiad_sim_peers::simulate(&s, 11).unwrap();
    }
    let a = &run0.recording.robots[&RobotId(2)].sightings; let b = &run1.recording.robots[&RobotId(2)].sightings;
    println!("{} {}", a.len(), b.len());
    let (mut l, mut r, mut nl, mut nr) = (0,0,0,0);
    for (x, y) in a.iter().zip(b) {
        if let (Reading::Sighting{target: t, ..}, Reading::Sighting{target: u, ..}) = (x.reading, y.reading) {
            let land = matches!(t, Target::Landmark(_));
            if land { nl += 1 } else { nr += 1 }
            if t != u { if land { l += 1 } else { r += 1 } }
        }
    }
    println!("landmark {l}/{nl} robot {r}/{nr}");
}
