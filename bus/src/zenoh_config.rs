//! How a zenoh session is opened.

use crate::BusError;

/// Heard by nobody outside this machine; the port is chosen by the system.
const LOOPBACK: &str = "tcp/127.0.0.1:0";

/// What a zenoh session is to the others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ZenohMode {
    /// Linked with every other peer it hears of.
    #[default]
    Peer,
    /// Linked with one router or peer, which it speaks through.
    Client,
    /// Forwards for clients.
    Router,
}

/// How a zenoh session is opened.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ZenohConfig {
    /// What it is to the others.
    pub mode: ZenohMode,
    /// Endpoints to listen at, for example `tcp/0.0.0.0:7447`. None means loopback at a free port (for a
    /// client: nowhere), never zenoh's own default of all interfaces.
    pub listen: Vec<String>,
    /// Endpoints to dial, again and again until they answer and whenever they are lost. Peers found by
    /// gossip are not dialled again, so name all peers; of two, one dials.
    pub connect: Vec<String>,
    /// Whether to look for others by multicast as well.
    pub multicast: bool,
}

impl ZenohConfig {
    /// The first endpoint, for error messages.
    pub(crate) fn endpoint(&self) -> String {
        self.listen.iter().chain(&self.connect).next().map_or_else(|| LOOPBACK.into(), Clone::clone)
    }

    /// The configuration in zenoh's own terms.
    pub(crate) fn to_zenoh(&self) -> Result<zenoh::Config, BusError> {
        let (mode, default_listen) = match self.mode {
            ZenohMode::Peer => ("\"peer\"", vec![LOOPBACK.to_owned()]),
            ZenohMode::Client => ("\"client\"", Vec::new()),
            ZenohMode::Router => ("\"router\"", vec![LOOPBACK.to_owned()]),
        };
        let listen = if self.listen.is_empty() { &default_listen } else { &self.listen };
        let list = |endpoints: &[String]| serde_json::Value::from(endpoints.to_vec()).to_string();
        let settings = [
            ("mode", mode.to_owned()),
            ("listen/endpoints", list(listen)),
            ("connect/endpoints", list(&self.connect)),
            // A healed partition, or an agent that is back, is noticed in half a second.
            (
                "connect/retry",
                "{period_init_ms: 200, period_max_ms: 500, period_increase_factor: 1.5}".into(),
            ),
            // Peers dial in the background for ever; a client needs its router, and waits for it a while.
            ("connect/timeout_ms", "{router: -1, peer: -1, client: 10000}".into()),
            ("scouting/multicast/enabled", self.multicast.to_string()),
            ("scouting/gossip/enabled", "true".into()),
            // A stopped or cut-off peer is noticed after this many milliseconds instead of ten seconds.
            ("transport/link/tx/lease", "2000".into()),
            // Nor is one waited for longer than this when dialled; the next attempt may find it back.
            ("transport/unicast/open_timeout", "3000".into()),
        ];
        let mut config = zenoh::Config::default();
        for (key, value) in settings {
            config.insert_json5(key, &value).map_err(|cause| BusError::Open {
                endpoint: self.endpoint(),
                cause: format!("zenoh does not take {value} for {key}: {cause}"),
            })?;
        }
        Ok(config)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn setting(config: &ZenohConfig, key: &str) -> serde_json::Value {
        serde_json::from_str(&config.to_zenoh().unwrap().get_json(key).unwrap()).unwrap()
    }

    #[test]
    fn nothing_listens_beyond_loopback_unless_told() {
        for (mode, expected) in [
            (ZenohMode::Peer, serde_json::json!(["tcp/127.0.0.1:0"])),
            (ZenohMode::Router, serde_json::json!(["tcp/127.0.0.1:0"])),
            (ZenohMode::Client, serde_json::json!([])),
        ] {
            let config = ZenohConfig { mode, ..ZenohConfig::default() };
            assert_eq!(setting(&config, "listen/endpoints"), expected);
            assert_eq!(setting(&config, "scouting/multicast/enabled"), false);
        }
        let listen = vec!["tcp/0.0.0.0:7447".to_owned()];
        let told = ZenohConfig { listen, multicast: true, ..ZenohConfig::default() };
        assert_eq!(setting(&told, "listen/endpoints"), serde_json::json!(["tcp/0.0.0.0:7447"]));
        assert_eq!(setting(&told, "scouting/multicast/enabled"), true);
    }

    #[test]
    fn lost_links_are_noticed_and_dialled_again_soon() {
        let config = ZenohConfig::default();
        assert_eq!(setting(&config, "transport/link/tx/lease"), 2000);
        assert_eq!(setting(&config, "transport/unicast/open_timeout"), 3000);
        let retry = setting(&config, "connect/retry");
        assert_eq!(retry["period_init_ms"], 200);
        assert_eq!(retry["period_max_ms"], 500);
        assert_eq!(retry["period_increase_factor"], 1.5);
        assert_eq!(setting(&config, "scouting/gossip/enabled"), true);
    }

    #[test]
    fn an_endpoint_that_is_none_is_refused() {
        let config = ZenohConfig { connect: vec!["nowhere".into()], ..ZenohConfig::default() };
        let refused = config.to_zenoh().unwrap_err().to_string();
        assert!(refused.contains("connect/endpoints") && refused.contains("nowhere"), "{refused}");
    }
}
