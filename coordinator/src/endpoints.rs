//! Endpoints for a team on one machine.

use std::collections::BTreeMap;
use std::net::{Ipv4Addr, TcpListener};

use pleiad_protocol::RobotId;

use crate::CoordinatorError;

/// Where an agent listens and whom it dials: `bus.listen` and `bus.connect` of its configuration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Endpoint {
    /// Where it listens.
    pub listen: String,
    /// All robots with lower numbers: of two robots, the higher one dials.
    pub connect: Vec<String>,
}

/// Free loopback ports, one per robot. All are held at once, so that they are distinct, and released on
/// return; until the agents bind them, another program could.
///
/// # Errors
/// [`CoordinatorError::NoPort`] if the system has none to give.
pub fn endpoints(robots: &[RobotId]) -> Result<BTreeMap<RobotId, Endpoint>, CoordinatorError> {
    let mut held = BTreeMap::new();
    for robot in robots {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0));
        let bound = listener.and_then(|listener| Ok((listener.local_addr()?, listener)));
        held.insert(*robot, bound.map_err(|cause| CoordinatorError::NoPort { robot: *robot, cause })?);
    }
    let mut lower = Vec::new();
    let assign = |(robot, (address, _)): (&RobotId, &(std::net::SocketAddr, TcpListener))| {
        let listen = format!("tcp/{address}");
        let endpoint = Endpoint { listen: listen.clone(), connect: lower.clone() };
        lower.push(listen);
        (*robot, endpoint)
    };
    Ok(held.iter().map(assign).collect())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::net::SocketAddr;

    use super::*;

    #[test]
    fn every_pair_is_linked_once_from_the_higher_to_the_lower() {
        let robots = [7, 1, 12, 3].map(RobotId);
        let endpoints = endpoints(&robots).unwrap();
        assert_eq!(endpoints.keys().copied().collect::<Vec<_>>(), [1, 3, 7, 12].map(RobotId));
        for (robot, endpoint) in &endpoints {
            let lower: Vec<_> = endpoints.range(..robot).map(|(_, lower)| lower.listen.clone()).collect();
            assert_eq!(endpoint.connect, lower);
        }
        let distinct: BTreeSet<_> = endpoints.values().map(|endpoint| &endpoint.listen).collect();
        assert_eq!(distinct.len(), robots.len());
    }

    #[test]
    fn ports_are_on_loopback_and_free_again() {
        for endpoint in endpoints(&[RobotId(1), RobotId(2)]).unwrap().values() {
            let address: SocketAddr = endpoint.listen.strip_prefix("tcp/").unwrap().parse().unwrap();
            assert!(address.ip().is_loopback() && address.port() != 0);
            TcpListener::bind(address).unwrap();
        }
    }
}
