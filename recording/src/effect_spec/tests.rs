use super::*;

fn spec(text: &str) -> EffectSpec {
    toml::from_str(text).expect("the form of an effect")
}

fn error(text: &str) -> String {
    spec(text).declared().expect_err(text).to_string()
}

#[test]
fn scalars_vectors_intervals_and_scope_are_read_in_the_order_of_the_components() {
    let declared = spec(
        "name = \"gps_lever_arm\"\nparameters = { offset_body_m = [0.22, -0.1] }\n\
         ci95 = { offset_body_m = [[0.21, 0.23], [-0.11, -0.09]] }\n\
         within = { region_m = [0.0, 1.0, 2.0, 3.0], time_s = [10.0, 20.0] }",
    )
    .declared()
    .expect("a sound effect");
    assert_eq!(declared.active.effect(), Effect::GpsLeverArm);
    assert_eq!(declared.active.values(), [0.22, -0.1]);
    assert_eq!(declared.ci95, [Some([0.21, 0.23]), Some([-0.11, -0.09])]);
    let scope = declared.active.scope;
    assert_eq!(scope.region, Some(Region { x_m: (0.0, 1.0), y_m: (2.0, 3.0) }));
    assert_eq!(scope.window_s, Some((10.0, 20.0)));
}

#[test]
fn a_parameter_that_is_left_out_is_off() {
    let declared = spec("name = \"actuator_gain\"\nparameters = { w_relative = -0.04 }").declared();
    assert_eq!(declared.expect("a sound effect").active.values(), [0.0, -0.04]);
    let declared = spec("name = \"castor_friction\"\nparameters = { heading_kick_rad = 0.1 }").declared();
    assert_eq!(declared.expect("a sound effect").active.values(), [0.1, 0.03]);
}

#[test]
fn a_whole_number_is_a_number() {
    let declared =
        spec("name = \"landmark_survey_error\"\nparameters = { id = 7, offset_m = [1, 0] }").declared();
    assert_eq!(declared.expect("a sound effect").active.values(), [7.0, 1.0, 0.0]);
}

#[test]
fn every_effect_at_its_typical_size_is_written_and_read_back_equal() {
    for &effect in Effect::ALL {
        let active = ActiveEffect::new(effect, &effect.typical_values()).expect("typical");
        let scope = Scope { region: Some(Region { x_m: (-1.0, 2.0), y_m: (0.0, 0.5) }), window_s: None };
        let count = active.values().len();
        for scope in [Scope::default(), scope] {
            let mut declared = DeclaredEffect::new(active.within(scope));
            for known in 0..=count {
                let written = toml::to_string(&EffectSpec::from(&declared)).expect("TOML");
                assert_eq!(spec(&written).declared(), Ok(declared.clone()), "{written}");
                if let Some(slot) = declared.ci95.get_mut(known) {
                    *slot = Some([-0.25, 1e-7]);
                }
            }
        }
    }
}

#[test]
fn what_is_wrong_is_told_by_key_and_with_what_to_give() {
    let lever = |rest: &str| format!("name = \"gps_lever_arm\"\n{rest}");
    let cases = [
        (
            "name = \"gps_levr_arm\"\nparameters = { x = 1.0 }".to_owned(),
            "key `name`: found \"gps_levr_arm\", expected an effect of the catalogue, perhaps \"gps_lever_arm\"",
        ),
        ("name = \"q\"\nparameters = { x = 1.0 }".to_owned(), "`pleiad effects` lists"),
        (
            lever("parameters = {}"),
            "key `parameters`: found no value, expected a value for a parameter of `gps_lever_arm`, which has: offset_body_m",
        ),
        (
            lever("parameters = { offset_m = [0.1, 0.2] }"),
            "key `parameters.offset_m`: found this parameter, expected",
        ),
        (
            lever("parameters = { offset_body_m = [0.1] }"),
            "found `[0.1]`, expected an array with a number for each of forward (m), left (m)",
        ),
        (lever("parameters = { offset_body_m = 0.1 }"), "found `0.1`, expected an array"),
        (lever("parameters = { offset_body_m = [nan, 0.1] }"), "found `[nan, 0.1]`"),
        (lever("parameters = { offset_body_m = [inf, 0.1] }"), "expected a finite number"),
        (
            lever(
                "parameters = { offset_body_m = [0.2, 0.1] }\nci95 = { offset_body_m = [[0.3, 0.1], [0.0, 0.1]] }",
            ),
            "key `ci95.offset_body_m`",
        ),
        (
            lever("parameters = { offset_body_m = [0.2, 0.1] }\nci95 = { offset = [0.1, 0.3] }"),
            "key `ci95.offset`",
        ),
        (
            lever(
                "parameters = { offset_body_m = [0.2, 0.1] }\nwithin = { region_m = [1.0, 0.0, 0.0, 1.0] }",
            ),
            "key `within.region_m`",
        ),
        (
            lever("parameters = { offset_body_m = [0.2, 0.1] }\nwithin = { time_s = [nan, 1.0] }"),
            "key `within.time_s`",
        ),
        (
            "name = \"gyro_bias\"\nparameters = { bias_rad_s = \"0.1\" }".to_owned(),
            "expected a number (rad/s)",
        ),
        (
            "name = \"wheel_radius_error\"\nparameters = { relative = -1.0 }".to_owned(),
            "expected a number above -1",
        ),
        (
            "name = \"acceleration_limit\"\nparameters = { m_s2 = 0.0 }".to_owned(),
            "expected a number above 0",
        ),
        (
            "name = \"sticky_wheel\"\nparameters = { wheel = 2 }".to_owned(),
            "expected a whole number from 0 to 1",
        ),
        (
            "name = \"sticky_wheel\"\nparameters = { wheel = 0.5 }".to_owned(),
            "expected a whole number from 0 to 1",
        ),
    ];
    for (text, expected) in cases {
        let error = error(&text);
        assert!(error.contains(expected), "{error}");
    }
}
