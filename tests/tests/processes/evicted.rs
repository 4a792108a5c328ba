//! An operator has a robot evicted that will not come back.

use pleiad_coordinator::{Exit, Team};
use pleiad_estimation::{RobotId, Timestamp};
use pleiad_tests::feeder::Feeder;
use pleiad_tests::program::{Ended, run};
use pleiad_tests::stage::{PATIENCE, Stage};

use crate::{ONE, THREE, TWO};

fn evict(stage: &Stage, robot: RobotId, more: &[&str]) -> Ended {
    let robot = robot.to_string();
    let mut arguments = vec!["evict", stage.team.as_str(), robot.as_str()];
    let endpoints = stage.endpoints();
    for endpoint in &endpoints {
        arguments.extend(["--connect", endpoint.as_str()]);
    }
    arguments.extend(more);
    let folder = tempfile::tempdir().unwrap();
    tokio::task::block_in_place(|| run(folder.path(), arguments))
}

/// Up to where a robot has closed its past.
async fn cut(stage: &Stage, robot: RobotId) -> Option<Timestamp> {
    let status = stage.status(robot).await.unwrap();
    status.closure.unwrap().cut.map(|(cut, _)| cut)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_others_close_their_past_again_once_a_robot_that_is_gone_is_evicted() {
    let mut stage = Stage::set(3).await;
    stage.tell(|config| {
        config.ledger.members = vec![1, 2, 3];
        config.ledger.cell_s = 1.0;
        config.ledger.late_s = 0.5;
    });
    let team = Team::launch(&stage.coordinator(), std::sync::Arc::clone(&stage.bus)).await.unwrap();
    team.wait_until_alive(PATIENCE).await.unwrap();
    let mut feeder = Feeder::start(&stage.bus, &stage.team, stage.samples(), 20.0);
    feeder.reached(20.0).await;

    // It is there: nobody would gain by its eviction.
    let refused = evict(&stage, THREE, &[]).failure();
    assert!(refused.contains("robot 3 answers") && refused.contains("--anyway"), "{refused}");

    assert_eq!(team.kill(THREE).await.unwrap(), Exit::Signal(9));
    feeder.go_on(40.0);
    feeder.reached(40.0).await;
    // Nobody closes a time that it has not sealed, however long it is away.
    for robot in [ONE, TWO] {
        assert!(cut(&stage, robot).await.is_none_or(|cut| cut.seconds() <= 21.0), "robot {robot}");
    }
    let told = evict(&stage, THREE, &[]).success();
    assert!(told.contains("robot 3 is evicted") && told.contains("decided by 1, 2"), "{told}");
    feeder.go_on(50.0);
    feeder.reached(50.0).await;
    for robot in [ONE, TWO] {
        let beyond = |cut: Option<(Timestamp, _)>| cut.is_some_and(|(cut, _)| cut.seconds() >= 40.0);
        stage.until(robot, |status| status.closure.as_ref().is_some_and(|own| beyond(own.cut))).await;
        assert_eq!(stage.status(robot).await.unwrap().closure.unwrap().epoch, 1);
    }
    let hash = async |robot| stage.status(robot).await.unwrap().closure.unwrap().cut;
    let (one, two) = (hash(ONE).await.unwrap(), hash(TWO).await.unwrap());
    assert!(one.0 != two.0 || one.1 == two.1, "one cut, two snapshots");
    // Once is enough: it is no member any more, and nothing is left to be decided.
    let again = evict(&stage, THREE, &["--within", "1"]).failure();
    assert!(again.contains("not decided at robot 1, robot 2") && again.contains("a member"), "{again}");
    team.shutdown(PATIENCE).await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_team_that_keeps_everything_evicts_nobody() {
    let stage = Stage::set(2).await;
    let mut agent = stage.start_agent(ONE);
    stage.until_up([ONE]).await;
    let refused = evict(&stage, TWO, &[]).failure();
    assert!(refused.contains("ledger.members"), "{refused}");
    let alone = evict(&stage, ONE, &["--anyway"]).failure();
    assert!(alone.contains("only one of its team"), "{alone}");
    stage.end(ONE).await;
    assert!(agent.wait().unwrap().success());
}
