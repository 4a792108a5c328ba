//! Every refusal, with a planted bad value.

use super::*;

/// The refusal of a message of one entry, from inside its entry.
fn refusal(entry: &Entry) -> ProtocolError {
    let bytes = encode_entries(std::slice::from_ref(entry));
    let Err(ProtocolError::Item { list: "entries", index: 0, cause }) = decode_entries(&bytes) else {
        panic!("accepted: {entry:?}")
    };
    let ProtocolError::Entry { id, cause } = *cause else { panic!("without the entry: {cause}") };
    assert_eq!(id, entry.id);
    *cause
}

/// A message whose body was written by hand, with the checksum that belongs to it.
fn by_hand(kind: u8, body: &[u8]) -> Vec<u8> {
    sealed(kind, |bytes| bytes.extend_from_slice(body))
}

fn number_refused(cause: ProtocolError) -> (String, f64) {
    let ProtocolError::Number { field, found, .. } = cause else { panic!("not a number: {cause}") };
    (field, found)
}

#[test]
fn lists_beyond_their_limits_are_refused_by_their_count() {
    let too_many = |message: &Message| match Message::decode(&message.encode()) {
        Err(ProtocolError::TooMany { field, found, limit }) => (field, found, limit),
        other => panic!("{other:?}"),
    };
    let plain = entry(plain_id(), Body::Profile(Profile { index: 0, noise: Noise::from_sigmas(&[0.1]) }));
    let entries = Message::Entries(vec![plain; limits::ENTRIES + 1]);
    assert_eq!(too_many(&entries), ("entries".into(), 513, 512));

    let log = LogId { robot: RobotId(1), boot: BootIndex(0) };
    let mut status = testing::status(&mut rng(1));
    status.logs = vec![LogStatus { log, held: 0, chain: Fingerprint::default() }; limits::LOGS + 1];
    assert_eq!(too_many(&Message::Status(status)), ("status.logs".into(), 4097, 4096));

    let ranges = vec![LogRange { log, from: 0, to: 1 }; limits::RANGES + 1];
    assert_eq!(too_many(&Message::FactsRequest(FactsRequest { ranges })), ("ranges".into(), 4097, 4096));

    let sample = Sample { time: Timestamp(0), reading: Reading::Gyro { yaw_rate_rad_s: 0.0 } };
    let batch = SensorBatch { samples: vec![sample; limits::SAMPLES + 1], ..SensorBatch::default() };
    assert_eq!(too_many(&Message::SensorBatch(batch)), ("samples".into(), 8193, 8192));
}

#[test]
fn an_extension_beyond_its_limit_is_refused() {
    let mut long = entry(plain_id(), Body::Observation(observation(RANGE_BEARING, NoiseRef::Profile(0))));
    long.extension = vec![0; limits::EXTENSION_BYTES + 1];
    let error = ProtocolError::TooMany { field: "extension".into(), found: 257, limit: 256 };
    assert_eq!(refusal(&long), error);
}

#[test]
fn texts_are_cut_when_sent_and_refused_when_too_long() {
    let ack = |length| SensorAck { first_refusal: Some("x".repeat(length)), ..SensorAck::default() };
    let sent = Message::SensorAck(ack(10_000)).encode();
    assert_eq!(Message::decode(&sent), Ok(Message::SensorAck(ack(limits::TEXT_BYTES))));

    // Written by hand: number, accepted, refused, Some, length 513 as a varint, text.
    let mut body = vec![0, 0, 0, 1, 251, 1, 2];
    body.extend_from_slice(&[b'x'; 513]);
    let bytes = by_hand(kind::SENSOR_ACK, &body);
    let error = ProtocolError::TooMany { field: "first_refusal".into(), found: 513, limit: 512 };
    assert_eq!(Message::decode(&bytes), Err(error));

    let mut body = vec![2, 251, 1, 2];
    body.extend_from_slice(&[b'x'; 513]);
    let bytes = by_hand(kind::CONTROL_REPLY, &body);
    let error = ProtocolError::TooMany { field: "refused".into(), found: 513, limit: 512 };
    assert_eq!(Message::decode(&bytes), Err(error));
}

#[test]
fn the_frame_of_a_message_is_checked() {
    let good = Message::ControlRequest(ControlRequest::Finish).encode();
    // The checksum is zlib.crc32(b"\x08\x01"), little-endian.
    assert_eq!(good, [2, 8, 1, 97, 168, 7, 254]);
    assert_eq!(Message::decode(&[]), Err(ProtocolError::TooShort { bytes: 0 }));
    assert_eq!(Message::decode(&[2]), Err(ProtocolError::TooShort { bytes: 1 }));
    assert_eq!(Message::decode(&[2, 8, 1]), Err(ProtocolError::TooShort { bytes: 3 }));
    assert_eq!(Message::decode(&[1, 8, 1]), Err(ProtocolError::Version { found: 1 }));
    let damaged = Message::decode(&[2, 8, 2, 97, 168, 7, 254]);
    assert!(matches!(damaged, Err(ProtocolError::Checksum { found: 0xfe07_a861, .. })), "{damaged:?}");
    for unknown in [0, 11] {
        assert_eq!(Message::decode(&by_hand(unknown, &[1])), Err(ProtocolError::Kind { found: unknown }));
    }
    assert_eq!(Message::decode(&by_hand(8, &[1, 0, 0])), Err(ProtocolError::Trailing { bytes: 2 }));
    for malformed in [by_hand(8, &[]), by_hand(8, &[3])] {
        let refused = Message::decode(&malformed);
        assert!(matches!(refused, Err(ProtocolError::Malformed { part: "control request", .. })));
    }
    let bytes = limits::MESSAGE_BYTES + 1;
    let refused = Message::decode(&vec![2; bytes]);
    assert_eq!(refused, Err(ProtocolError::TooLong { bytes, limit: limits::MESSAGE_BYTES }));
    let other = ProtocolError::OtherKind { found: "control request", expected: "entries" };
    assert_eq!(decode_entries(&good), Err(other));
    let other = ProtocolError::OtherKind { found: "control request", expected: "sample" };
    assert_eq!(decode_sample(&good), Err(other));
}

#[test]
fn a_yaw_that_would_be_wrapped_is_refused() {
    let pose = |yaw_rad: f64| {
        let bytes = encode_sample(&Sample {
            time: Timestamp(0),
            reading: Reading::Increment(Pose2::new(1.0, 2.0, 0.0)),
        });
        let mut body = bytes[2..bytes.len() - limits::CHECKSUM_BYTES].to_vec();
        let end = body.len();
        body[end - 8..].copy_from_slice(&yaw_rad.to_le_bytes());
        decode_sample(&by_hand(kind::SAMPLE, &body))
    };
    assert!(pose(PI).is_ok());
    assert!(pose((-PI).next_up()).is_ok());
    for yaw in [-PI, PI.next_up(), 7.0, f64::INFINITY] {
        assert_eq!(number_refused(pose(yaw).unwrap_err()), ("increment.yaw_rad".into(), yaw));
    }
    assert!(number_refused(pose(f64::NAN).unwrap_err()).1.is_nan());
}

#[test]
fn a_bad_number_anywhere_in_an_observation_is_named() {
    let bad = f64::INFINITY;
    let relative_field = |relative| {
        let body = Body::Observation(observation(relative, NoiseRef::Profile(0)));
        number_refused(refusal(&entry(plain_id(), body))).0
    };
    let quantity = |field: &str| format!("observation.quantity.relative.{field}");
    assert_eq!(relative_field(Relative::Range { range_m: bad }), quantity("range_m"));
    assert_eq!(relative_field(Relative::Bearing { bearing_rad: bad }), quantity("bearing_rad"));
    assert_eq!(
        relative_field(Relative::RangeBearing { range_m: 1.0, bearing_rad: bad }),
        quantity("bearing_rad")
    );
    assert_eq!(
        relative_field(Relative::RangeBearing { range_m: bad, bearing_rad: 1.0 }),
        quantity("range_m")
    );
    assert_eq!(relative_field(Relative::Position { x_m: bad, y_m: 1.0 }), quantity("x_m"));
    assert_eq!(relative_field(Relative::Position { x_m: 1.0, y_m: bad }), quantity("y_m"));
    assert_eq!(relative_field(Relative::Pose(Pose2::new(bad, 0.0, 0.0))), quantity("x_m"));

    let field = |change: &dyn Fn(&mut Observation)| {
        let mut observation = observation(RANGE_BEARING, NoiseRef::Profile(0));
        change(&mut observation);
        number_refused(refusal(&entry(plain_id(), Body::Observation(observation)))).0
    };
    let observer = |o: &mut Observation| o.observer.nominal = Pose2::new(0.0, bad, 0.0);
    assert_eq!(field(&observer), "observation.observer.nominal.y_m");
    let noise_sum = |o: &mut Observation| o.observer.noise_sum = Symmetric3::diagonal(bad, 1.0, 1.0);
    assert_eq!(field(&noise_sum), "observation.observer.noise_sum");
    let absolute = |absolute| move |o: &mut Observation| o.quantity = Quantity::Absolute(absolute);
    assert_eq!(field(&absolute(Absolute::Heading(bad))), "observation.quantity.heading");
    assert_eq!(field(&absolute(Absolute::Position([0.0, bad]))), "observation.quantity.position");
    assert_eq!(field(&absolute(Absolute::Pose(Pose2::new(bad, 0.0, 0.0)))), "observation.quantity.pose.x_m");
    let landmark = |o: &mut Observation| {
        let landmark = LandmarkId(1);
        o.quantity = Quantity::Landmark { landmark, position_m: [bad, 0.0], relative: RANGE_BEARING };
    };
    assert_eq!(field(&landmark), "observation.quantity.position_m");
}

#[test]
fn indefinite_covariances_are_named_wherever_they_are() {
    let found = [1.0, 0.0, 1.0, 0.0, 0.0, -1.0];
    let bad = Symmetric3(found);
    let field = |body| match refusal(&entry(plain_id(), body)) {
        ProtocolError::Covariance { field, found: named, .. } => {
            assert_eq!(Symmetric3(named), bad);
            field
        }
        other => panic!("{other}"),
    };
    let bad_state = NominalState { noise_sum: bad, ..state() };
    let mut seen = observation(RANGE_BEARING, NoiseRef::Profile(0));
    seen.observer = bad_state;
    assert_eq!(field(Body::Observation(seen)), "observation.observer.noise_sum");
    let answer = Answer::State { boot: BootIndex(0), state: bad_state };
    assert_eq!(field(Body::Half(Half { observation: plain_id(), answer })), "half.state.noise_sum");
    let boot = |last, gap| {
        let time = Timestamp(0);
        let continuation = Some(Continuation { previous: BootIndex(0), time, last, gap });
        let nominal = Pose2::identity();
        Body::Boot(Boot { time, nonce: 1, configuration: 2, nominal, continuation, calibration: None })
    };
    assert_eq!(field(boot(state(), bad)), "boot.continuation.gap");
    assert_eq!(field(boot(bad_state, Symmetric3::zero())), "boot.continuation.last.noise_sum");
    let profile = Profile { index: 0, noise: Noise { dimension: 3, lower: found } };
    assert_eq!(field(Body::Profile(profile)), "profile.noise");
    let noise = NoiseRef::Explicit(Noise { dimension: 3, lower: found });
    let relative = Relative::Pose(Pose2::identity());
    assert_eq!(field(Body::Observation(observation(relative, noise))), "observation.noise");
}

#[test]
fn an_explicit_noise_must_fit_its_quantity() {
    let relative = |relative| Quantity::Robot { robot: RobotId(3), relative };
    let quantities = [
        (relative(Relative::Range { range_m: 1.0 }), 1),
        (relative(Relative::Bearing { bearing_rad: 1.0 }), 1),
        (relative(RANGE_BEARING), 2),
        (relative(Relative::Position { x_m: 1.0, y_m: 1.0 }), 2),
        (relative(Relative::Pose(Pose2::identity())), 3),
        (Quantity::Absolute(Absolute::Heading(0.1)), 1),
        (Quantity::Absolute(Absolute::Position([0.1, 0.2])), 2),
        (Quantity::Absolute(Absolute::Pose(Pose2::identity())), 3),
    ];
    for (quantity, dimension) in quantities {
        for found in 1..=3 {
            let noise = NoiseRef::Explicit(Noise::from_sigmas(&[0.1; 3][..usize::from(found)]));
            let seen = Observation { quantity, noise, ..observation(RANGE_BEARING, noise) };
            let entry = entry(plain_id(), Body::Observation(seen));
            if found == dimension {
                assert_eq!(decode_entries(&encode_entries(std::slice::from_ref(&entry))), Ok(vec![entry]));
            } else {
                let refused = refusal(&entry);
                let ProtocolError::Dimension { field, found: f, expected } = refused else {
                    panic!("{refused}")
                };
                assert_eq!((field.as_str(), f), ("observation.noise", found));
                assert!(expected.starts_with(&dimension.to_string()), "{expected}");
            }
        }
    }
}

#[test]
fn a_bad_number_in_any_sample_is_named() {
    let bad = f64::NEG_INFINITY;
    let robot = Target::Robot(RobotId(1));
    let landmark = Target::Landmark(LandmarkId(1));
    let relative = Relative::Range { range_m: bad };
    for (reading, expected) in [
        (Reading::Velocity { forward_m_s: bad, yaw_rate_rad_s: 0.0 }, "velocity.forward_m_s"),
        (Reading::Velocity { forward_m_s: 0.0, yaw_rate_rad_s: bad }, "velocity.yaw_rate_rad_s"),
        (Reading::Wheels { left_rad: bad, right_rad: 0.0 }, "wheels.left_rad"),
        (Reading::Wheels { left_rad: 0.0, right_rad: bad }, "wheels.right_rad"),
        (Reading::Increment(Pose2::new(bad, 0.0, 0.0)), "increment.x_m"),
        (Reading::Gyro { yaw_rate_rad_s: bad }, "gyro.yaw_rate_rad_s"),
        (Reading::Gps { x_m: bad, y_m: 0.0 }, "gps.x_m"),
        (Reading::Gps { x_m: 0.0, y_m: bad }, "gps.y_m"),
        (Reading::Heading { heading_rad: bad }, "heading.heading_rad"),
        (Reading::Sighting { target: robot, relative }, "sighting.relative.range_m"),
        (Reading::Sighting { target: landmark, relative }, "sighting.relative.range_m"),
    ] {
        let refused = decode_sample(&encode_sample(&Sample { time: Timestamp(0), reading })).unwrap_err();
        assert_eq!(number_refused(refused), (expected.into(), bad));
    }
    let good = Sample { time: Timestamp(0), reading: Reading::Gyro { yaw_rate_rad_s: 0.0 } };
    let reading = Reading::Gyro { yaw_rate_rad_s: bad };
    let samples = vec![good, Sample { time: Timestamp(0), reading }];
    let batch = Message::SensorBatch(SensorBatch { samples, ..SensorBatch::default() });
    let refused = Message::decode(&batch.encode());
    assert!(matches!(refused, Err(ProtocolError::Item { list: "samples", index: 1, .. })), "{refused:?}");
}

#[test]
fn a_bad_estimate_is_refused_field_by_field() {
    let good = Estimate {
        robot: RobotId(1),
        boot: BootIndex(0),
        time: Timestamp(1),
        map_from_odom: Pose2::identity(),
        odom_from_robot: Pose2::identity(),
        map_from_robot: Pose2::identity(),
        covariance: Symmetric3::diagonal(1.0, 1.0, 1.0),
        sigma: [1.0; 3],
        facts_used: 3,
    };
    let refused = |estimate: Estimate| Message::decode(&Message::Estimate(estimate).encode()).unwrap_err();
    assert!(Message::decode(&Message::Estimate(good).encode()).is_ok());
    let bad = Pose2::new(f64::INFINITY, 0.0, 0.0);
    let field = |estimate| number_refused(refused(estimate)).0;
    assert_eq!(field(Estimate { map_from_odom: bad, ..good }), "estimate.map_from_odom.x_m");
    assert_eq!(field(Estimate { odom_from_robot: bad, ..good }), "estimate.odom_from_robot.x_m");
    assert_eq!(field(Estimate { map_from_robot: bad, ..good }), "estimate.map_from_robot.x_m");
    assert_eq!(field(Estimate { sigma: [1.0, -1.0, 1.0], ..good }), "estimate.sigma");
    assert_eq!(field(Estimate { sigma: [1.0, f64::INFINITY, 1.0], ..good }), "estimate.sigma");
    let covariance = Symmetric3::diagonal(1.0, 1.0, -1.0);
    assert!(matches!(refused(Estimate { covariance, ..good }), ProtocolError::Covariance { .. }));
}

#[test]
fn a_range_that_ends_before_it_begins_is_refused() {
    let log = LogId { robot: RobotId(1), boot: BootIndex(0) };
    let ranges = vec![LogRange { log, from: 3, to: 3 }, LogRange { log, from: 3, to: 2 }];
    let refused = Message::decode(&Message::FactsRequest(FactsRequest { ranges }).encode());
    let cause = Box::new(ProtocolError::Range { field: "range".into(), from: 3, to: 2 });
    assert_eq!(refused, Err(ProtocolError::Item { list: "ranges", index: 1, cause }));
}

#[test]
fn a_refusal_says_which_entry_which_field_and_what_was_found() {
    let relative = Relative::RangeBearing { range_m: f64::INFINITY, bearing_rad: 0.0 };
    let bad = entry(plain_id(), Body::Observation(observation(relative, NoiseRef::Profile(0))));
    let void = Half { observation: plain_id(), answer: Answer::Void(VoidReason::Clock) };
    let bytes = encode_entries(&[entry(plain_id(), Body::Half(void)), bad]);
    assert_eq!(
        decode_entries(&bytes).unwrap_err().to_string(),
        "entries[1]: robot 1 boot 0 entry 5: observation.quantity.relative.range_m: found inf, \
         expected a finite number within +-1e15"
    );
}
