use std::collections::BTreeMap;

use super::*;
use crate::class::Class;
use crate::oracle::Oracle;

fn options(folder: &Path) -> Options {
    Options {
        classes: vec![Class::Clean.into(), Class::Single.into()],
        first_seed: 1,
        seeds: 1,
        only: vec!["clean/".to_owned()],
        resume: true,
        ablations: Vec::new(),
        baselines: false,
        folder: folder.to_owned(),
    }
}

/// A result that no diagnosis gives, with the hash of the answer or another.
fn made_up(plan: &Plan, hash: Option<&str>) -> CaseResult {
    let answer = plan.build().unwrap().answer;
    CaseResult {
        id: answer.id.clone(),
        answer_sha256: hash.map_or_else(|| answer.hash().unwrap(), str::to_owned),
        class: answer.class,
        noise: answer.noise,
        size: answer.size,
        oracle: Oracle::default(),
        tool: Scored { verdict: "made up".to_owned(), ..Scored::default() },
        ablations: BTreeMap::new(),
        added: None,
        baselines: BTreeMap::new(),
    }
}

#[test]
fn what_has_a_result_is_not_run_again() {
    let folder = tempfile::tempdir().unwrap();
    let options = options(folder.path());
    let plans = chosen(&options).unwrap();
    assert_eq!(plans.len(), 3);
    let file = folder.path().join(RESULTS);
    for plan in &plans {
        results::append(&file, &made_up(plan, None)).unwrap();
    }
    // A line that was being written when the run stopped.
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, format!("{text}{{\"id\":\"cle")).unwrap();
    let outcome = run(&options, &mut |_| {}).unwrap();
    assert!(outcome.results.iter().all(|own| own.tool.verdict == "made up") && outcome.resumed == 3);
    assert_eq!(fs::read_to_string(&file).unwrap(), text);
    let answers = fs::read(folder.path().join(ANSWERS)).unwrap();
    assert_eq!(sha256(&answers), outcome.sealed);
    assert!(fs::read_to_string(folder.path().join(SEAL)).unwrap().starts_with(&outcome.sealed));
    let fresh = Options { resume: false, ..options };
    assert!(matches!(run(&fresh, &mut |_| {}), Err(BenchmarkError::AlreadyThere { .. })));
}

#[test]
fn a_result_of_another_answer_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let options = options(folder.path());
    let plans = chosen(&options).unwrap();
    results::append(&folder.path().join(RESULTS), &made_up(&plans[0], None)).unwrap();
    results::append(&folder.path().join(RESULTS), &made_up(&plans[1], Some("0123"))).unwrap();
    let error = run(&options, &mut |_| {}).unwrap_err();
    assert!(
        matches!(&error, BenchmarkError::OtherAnswers { line: 2, found, .. } if found == "0123"),
        "{error}"
    );
}

#[test]
fn what_makes_no_sense_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let own = options(folder.path());
    let none = Options { seeds: 0, ..own.clone() };
    assert_eq!(chosen(&none).unwrap_err().to_string(), "0 seeds: nothing would be run; ask for at least 1");
    let unknown = Options { only: vec!["crap".to_owned()], ..own };
    let said = chosen(&unknown).unwrap_err().to_string();
    assert!(said.contains("has crap in") && said.contains("clean/nothing/white/1"), "{said}");
    let of = |text: &str| text.parse::<Asked>();
    assert_eq!(of("clean:7").unwrap(), Asked { class: Class::Clean, seeds: Some(7) });
    assert!(matches!(of("clean:0"), Err(BenchmarkError::NoSeeds)));
    assert!(of("clean:many").unwrap_err().to_string().contains("clean:100"));
    let said = "cleen".parse::<Class>().unwrap_err().to_string();
    assert!(said.contains("\"cleen\"") && said.contains("clean, single, masked"), "{said}");
}

#[test]
fn a_case_depends_on_its_name_and_on_nothing_else() {
    let all = plans(&Class::ALL.map(Asked::from), 1, 2);
    let alone = plans(&[Class::Decoy.into()], 2, 1);
    for own in &alone {
        let same = all.iter().find(|other| other.id == own.id).unwrap();
        let (a, b) = (own.build().unwrap(), same.build().unwrap());
        assert_eq!((a.answer, a.seed, a.scenario), (b.answer, b.seed, b.scenario));
    }
    let mut names: Vec<&String> = all.iter().map(|own| &own.id).collect();
    names.sort();
    names.dedup();
    assert_eq!(names.len(), all.len());
}

#[test]
fn every_answer_is_what_the_scenario_has() {
    for plan in plans(&[Class::Single, Class::Buried, Class::Cancelling].map(Asked::from), 3, 1) {
        let case = plan.build().unwrap();
        for own in &case.answer.injected {
            for robot in &own.robots {
                let effects = &case.scenario.robots[&pleiad_estimation::RobotId(*robot)].effects;
                let active = effects.iter().find(|active| active.effect().name() == own.effect).unwrap();
                let info = active.effect().info();
                for (parameter, value) in info.parameters.iter().zip(active.values()) {
                    assert_eq!(own.parameters[&parameter.label()].to_bits(), value.to_bits(), "{}", plan.id);
                }
            }
        }
        assert!(case.scenario.validate().is_ok(), "{}", plan.id);
    }
}

#[test]
fn the_masked_robot_comes_back_one_way_round_and_not_the_other() {
    let plan = plans(&[Class::Masked.into()], 1, 1).remove(0);
    let case = plan.build().unwrap();
    let robot = pleiad_estimation::RobotId(case.answer.injected[0].robots[0]);
    // Where a robot is after its first square and the stop at the corner, from where it started.
    let end_m = |scenario: &Scenario| {
        let track = &simulate(scenario, case.seed).unwrap().tracks[&robot];
        let script = &scenario.robots[&robot].motion.script;
        // Standing still first, then four times a side, a stop, a turn and a stop.
        let lap_s: f64 = script[..17].iter().map(|row| row[2]).sum();
        let end = track.pose_at(pleiad_estimation::Timestamp::from_seconds(lap_s)).position();
        (end - track.start().position()).norm()
    };
    let mut clockwise = case.scenario.clone();
    for row in &mut clockwise.robots.get_mut(&robot).unwrap().motion.script {
        row[1] = -row[1];
    }
    let (masked_m, shown_m) = (end_m(&case.scenario), end_m(&clockwise));
    assert!(masked_m < 0.01, "comes back to {masked_m} m");
    assert!(shown_m > 1.0, "comes back to {shown_m} m");
}
