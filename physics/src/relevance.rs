//! From which size on a significant value is a finding.

/// Standard gravity (CGPM 1901), m/s^2.
pub(crate) const GRAVITY_M_S2: f64 = 9.806_65;

/// The declared floors of real rolling contact: departures from the ideal model that are no effect. Zero
/// where a recording declares none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Floors {
    /// Lateral velocity up to this times `v w`, seconds.
    pub lateral_slip_s: f64,
    /// Apparent timing error of gyro and other readings, seconds.
    pub sensor_lag_s: f64,
    /// Apparent timing error of the servo, seconds.
    pub command_lag_s: f64,
    /// The declared servo time constant, seconds: some thresholds are a share of it.
    pub servo_time_constant_s: f64,
}

/// A threshold of relevance: an equivalence bound on a coefficient, never added to the noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Relevance {
    /// Any size counts, because another parameter of the effect carries its size.
    Unbounded,
    /// This size.
    Size(f64),
    /// The declared lateral slip, at least this (seconds).
    LateralSlip(f64),
    /// The declared lag of readings plus this (seconds).
    SensorLag(f64),
    /// The declared lag of commands plus this (seconds).
    CommandLag(f64),
    /// The declared lag of commands, at least 15 % of the servo time constant, plus this (seconds).
    Lag(f64),
    /// A tenth of the servo time constant, at least this (seconds).
    LagChange(f64),
    /// The slope, in radians, on which the servo gives way by this speed (m/s).
    Slope(f64),
}

impl Relevance {
    /// The threshold for a robot with these floors, in the parameter's unit.
    pub fn threshold(self, floors: &Floors) -> f64 {
        match self {
            Self::Unbounded => 0.0,
            Self::Size(size) => size,
            Self::LateralSlip(least) => floors.lateral_slip_s.max(least),
            Self::SensorLag(margin) => floors.sensor_lag_s + margin,
            Self::CommandLag(margin) => floors.command_lag_s + margin,
            Self::Lag(margin) => floors.command_lag_s.max(0.15 * floors.servo_time_constant_s) + margin,
            Self::LagChange(least) => (0.1 * floors.servo_time_constant_s).max(least),
            Self::Slope(droop_m_s) => droop_m_s / (GRAVITY_M_S2 * floors.servo_time_constant_s),
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "values that are exact by construction")]
mod tests {
    use super::*;

    #[test]
    fn declared_floors_raise_thresholds() {
        let floors = Floors {
            lateral_slip_s: 0.003,
            sensor_lag_s: 0.0015,
            command_lag_s: 0.001,
            servo_time_constant_s: 0.02,
        };
        for (relevance, without, with) in [
            (Relevance::Unbounded, 0.0, 0.0),
            (Relevance::Size(0.004), 0.004, 0.004),
            (Relevance::LateralSlip(0.005), 0.005, 0.005),
            (Relevance::LateralSlip(0.002), 0.002, 0.003),
            (Relevance::SensorLag(0.002), 0.002, 0.0035),
            (Relevance::CommandLag(0.001), 0.001, 0.002),
            (Relevance::Lag(0.001), 0.001, 0.004),
            (Relevance::LagChange(0.001), 0.001, 0.002),
            (Relevance::Slope(8e-4), f64::INFINITY, 8e-4 / 0.196_133),
        ] {
            for (floors, expected) in [(Floors::default(), without), (floors, with)] {
                let found = relevance.threshold(&floors);
                assert!(found == expected || (found - expected).abs() < 1e-15, "{relevance:?}: {found}");
            }
        }
    }
}
