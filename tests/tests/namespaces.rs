//! Agents in network namespaces of their own, on a wire of their own: what is cut and slow here is cut and slow in
//! the kernel. Needs the right to make namespaces (root); says so on stderr where it is missing, and checks nothing.
//!
//! Every robot has two interfaces: one to a switch that all robots share, one to its sensors. The addresses are those
//! of namespaces that this test makes, and removes again.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "helpers of tests")]

use std::fs::File;
use std::io::Write as _;
use std::os::fd::AsFd as _;
use std::process::Command;

use pleiad_bus::{ZenohConfig, ZenohMode};
use pleiad_estimation::RobotId;
use pleiad_tests::feeder::Feeder;
use pleiad_tests::folded::log;
use pleiad_tests::stage::Stage;
use rustix::thread::{LinkNameSpaceType, move_into_link_name_space};

const ROBOTS: u32 = 3;
const THREE: RobotId = RobotId(3);
/// Standard output of a test that passes is not shown; this is.
fn say(text: &str) {
    let _ = std::io::stderr().write_all(format!("{text}\n").as_bytes());
}

/// Runs a command of the network; what it said if it failed.
fn network(words: &str) -> Result<(), String> {
    let mut parts = words.split_whitespace();
    let program = parts.next().unwrap_or_default();
    match Command::new(program).args(parts).output() {
        Err(cause) => Err(format!("{words}: {cause}")),
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => Err(format!("{words}: {}", String::from_utf8_lossy(&output.stderr).trim())),
    }
}

/// The namespaces of one run: a switch, an operator with the sensors, and the robots. Dropped, they are gone.
struct Wires {
    name: String,
}

impl Wires {
    /// Lays them; the reason if that is not permitted.
    fn lay() -> Result<Self, String> {
        let wires = Self { name: format!("pleiad{}", std::process::id()) };
        let (switch, operator) = (wires.of("switch"), wires.of("operator"));
        for name in wires.all() {
            network(&format!("ip netns add {name}"))?;
            network(&format!("ip -n {name} link set lo up"))?;
        }
        network(&format!("ip -n {switch} link add bridge type bridge"))?;
        network(&format!("ip -n {switch} link set bridge up"))?;
        for robot in 1..=ROBOTS {
            let own = wires.of(&robot.to_string());
            network(&format!("ip -n {switch} link add r{robot} type veth peer name team netns {own}"))?;
            network(&format!("ip -n {switch} link set r{robot} master bridge up"))?;
            network(&format!("ip -n {own} address add 10.213.0.{robot}/24 dev team"))?;
            network(&format!("ip -n {own} link set team up"))?;
            network(&format!("ip -n {operator} link add s{robot} type veth peer name sensors netns {own}"))?;
            network(&format!("ip -n {operator} address add 10.214.{robot}.1/24 dev s{robot}"))?;
            network(&format!("ip -n {operator} link set s{robot} up"))?;
            network(&format!("ip -n {own} address add 10.214.{robot}.2/24 dev sensors"))?;
            network(&format!("ip -n {own} link set sensors up"))?;
        }
        Ok(wires)
    }

    fn of(&self, what: &str) -> String {
        format!("{}-{what}", self.name)
    }

    fn all(&self) -> Vec<String> {
        let robots = (1..=ROBOTS).map(|robot| robot.to_string());
        ["switch", "operator"]
            .into_iter()
            .map(String::from)
            .chain(robots)
            .map(|what| self.of(&what))
            .collect()
    }

    /// Makes the wires of all robots slow or lossy; says by what.
    fn burden(&self) -> Result<&'static str, String> {
        let lossy = "netem delay 20ms 10ms loss 10%";
        let narrow = "tbf rate 400kbit burst 4kb latency 30ms";
        let kinds = [(lossy, "netem: 20 ms and 10 % loss"), (narrow, "tbf: 400 kbit/s, the rest dropped")];
        let mut refused = String::new();
        for (kind, words) in kinds {
            let laid = (1..=ROBOTS).try_for_each(|robot| {
                let switch = self.of("switch");
                network(&format!("ip netns exec {switch} tc qdisc replace dev r{robot} root {kind}"))
            });
            match laid {
                Ok(()) => return Ok(words),
                Err(cause) => refused = cause,
            }
        }
        Err(refused)
    }

    /// Cuts a robot's wire to the team, or mends it.
    fn set(&self, robot: RobotId, state: &str) {
        network(&format!("ip -n {} link set r{robot} {state}", self.of("switch"))).unwrap();
    }
}

impl Drop for Wires {
    fn drop(&mut self) {
        for name in self.all() {
            let pids = Command::new("ip").args(["netns", "pids", &name]).output();
            let pids =
                pids.map(|output| String::from_utf8_lossy(&output.stdout).into_owned()).unwrap_or_default();
            // This process has a thread in one of them.
            for pid in pids.split_whitespace().filter(|pid| **pid != std::process::id().to_string()) {
                let _ = network(&format!("kill -KILL {pid}"));
            }
            let _ = network(&format!("ip netns delete {name}"));
        }
    }
}

async fn parted_and_healed(wires: &Wires) {
    let mut stage = Stage::set(ROBOTS).await;
    stage.tell(|config| {
        let team = |robot: u32| format!("tcp/10.213.0.{robot}:7447");
        config.bus.listen = vec![team(config.robot), format!("tcp/10.214.{}.2:7447", config.robot)];
        config.bus.connect = (1..config.robot).map(team).collect();
    });
    let connect = (1..=ROBOTS).map(|robot| format!("tcp/10.214.{robot}.2:7447")).collect();
    stage.reach(&ZenohConfig { mode: ZenohMode::Peer, connect, ..ZenohConfig::default() }).await;
    let mut agents = Vec::new();
    for robot in stage.robots() {
        let namespace = wires.of(&robot.to_string());
        agents.push(stage.start_agent_through(robot, &["ip", "netns", "exec", &namespace]));
    }
    stage.until_up(stage.robots()).await;
    match wires.burden() {
        Ok(kind) => say(&format!("namespaces: wires under {kind}")),
        Err(cause) => say(&format!("namespaces: wires are perfect, tc is not permitted: {cause}")),
    }

    let mut feeder = Feeder::start(&stage.bus, &stage.team, stage.samples(), 15.0);
    feeder.reached(15.0).await;
    wires.set(THREE, "down");
    feeder.go_on(40.0);
    feeder.reached(40.0).await;
    // Each side knows of the other what it knew before, and goes on with its own sensors.
    let held = |status: &pleiad_protocol::Status, robot: u32| {
        let own = status.logs.iter().find(|entry| entry.log == log(RobotId(robot), 0));
        own.map_or(0, |entry| entry.held)
    };
    let [one, three] = [stage.status(RobotId(1)).await.unwrap(), stage.status(THREE).await.unwrap()];
    assert!(held(&three, 1) < held(&one, 1) && held(&one, 3) < held(&three, 3), "{one:?}\n{three:?}");
    assert_ne!(one.estimate, three.estimate);
    wires.set(THREE, "up");
    let reports = feeder.end().await;
    let statuses = stage.settled().await;
    let ledger = stage.assert_undisturbed(&statuses);
    for (robot, report) in &reports {
        assert_eq!((report.lost, report.refused), (0, 0), "robot {robot}: {report:?}");
    }
    // Bit for bit what nodes without processes, wires and cuts believe.
    assert_eq!(ledger.clone().fingerprint(), stage.in_process().fingerprint());
    stage.shut_down().await;
    for mut agent in agents {
        assert!(agent.wait().unwrap().success());
    }
}

#[test]
fn a_robot_whose_wire_is_cut_comes_back_to_the_same_bits() {
    let wires = match Wires::lay() {
        Ok(wires) => wires,
        Err(cause) => {
            say(&format!(
                "\nSKIPPED: a team in network namespaces was NOT tested, because they are not permitted here: \
                 {cause}\nRun as root, with ip (iproute2).\n"
            ));
            return;
        }
    };
    // A thread of its own goes into the operator's namespace, and with it every thread it starts.
    std::thread::scope(|scope| {
        let inside = scope.spawn(|| {
            let namespace = File::open(format!("/run/netns/{}", wires.of("operator"))).unwrap();
            move_into_link_name_space(namespace.as_fd(), Some(LinkNameSpaceType::Network)).unwrap();
            let mut runtime = tokio::runtime::Builder::new_multi_thread();
            runtime.worker_threads(2).enable_all().build().unwrap().block_on(parted_and_healed(&wires));
        });
        if let Err(panic) = inside.join() {
            std::panic::resume_unwind(panic);
        }
    });
}

#[test]
fn what_the_network_refuses_is_told_with_the_command() {
    let refused = network("ip netns add").unwrap_err();
    assert!(refused.starts_with("ip netns add: "), "{refused}");
    assert!(network("there-is-no-such-program").unwrap_err().contains("there-is-no-such-program"));
}
