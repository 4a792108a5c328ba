//! Products of what a robot does, that stand in for a name.

use std::fmt::Write as _;

/// What monomials are made of, by the position in an [`Instant`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Base {
    /// Forward speed, m/s; of the actuator, the speed that is asked for.
    Speed,
    /// Yaw rate, rad/s; of the actuator, the one that is asked for.
    YawRate,
    /// Forward acceleration, m/s^2.
    Acceleration,
    /// Yaw acceleration, rad/s^2.
    YawAcceleration,
    /// Heading in the map, radians.
    Heading,
    /// Position in the map, metres.
    X,
    Y,
    /// Angle of a wheel, radians.
    LeftWheel,
    RightWheel,
    /// Of a sighting: metres, radians.
    Range,
    Bearing,
    /// Seconds; no monomial has it.
    Time,
}

/// How many bases there are.
const BASES: usize = 12;
/// Those whose cosine and sine are kept: many monomials ask for them.
const ANGLES: [Base; 3] = [Base::Heading, Base::LeftWheel, Base::RightWheel];

/// The value of every base; NaN where it is not known.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Instant {
    values: [f64; BASES],
    circles: [[f64; 2]; ANGLES.len()],
}

impl Instant {
    /// Nothing is known but these.
    pub(crate) fn of(known: &[(Base, f64)]) -> Self {
        let mut values = [f64::NAN; BASES];
        for &(base, value) in known {
            values[base as usize] = value;
        }
        let circle = |base: Base| {
            let angle = values[base as usize];
            [libm::cos(angle), libm::sin(angle)]
        };
        Self { values, circles: ANGLES.map(circle) }
    }

    pub(crate) fn get(&self, base: Base) -> f64 {
        self.values[base as usize]
    }

    /// Cosine and sine of an angle.
    fn circle(&self, base: Base) -> [f64; 2] {
        let kept = ANGLES.iter().position(|own| *own == base).map(|position| self.circles[position]);
        kept.unwrap_or_else(|| [libm::cos(self.get(base)), libm::sin(self.get(base))])
    }
}

impl Base {
    /// Its symbol, and the powers of metre, second and radian in its unit.
    pub(crate) const fn symbol(self) -> (&'static str, [i8; 3]) {
        match self {
            Self::Speed => ("v", [1, -1, 0]),
            Self::YawRate => ("w", [0, -1, 1]),
            Self::Acceleration => ("a", [1, -2, 0]),
            Self::YawAcceleration => ("dw/dt", [0, -2, 1]),
            Self::Heading => ("heading", [0, 0, 1]),
            Self::X => ("x", [1, 0, 0]),
            Self::Y => ("y", [1, 0, 0]),
            Self::LeftWheel => ("left wheel", [0, 0, 1]),
            Self::RightWheel => ("right wheel", [0, 0, 1]),
            Self::Range => ("r", [1, 0, 0]),
            Self::Bearing => ("b", [0, 0, 1]),
            Self::Time => ("t", [0, 1, 0]),
        }
    }

    /// Below this it is noise, and has no sign.
    const fn least(self) -> f64 {
        match self {
            Self::Speed => 0.005,
            Self::YawRate => 0.01,
            Self::Acceleration => 0.02,
            Self::YawAcceleration => 0.05,
            _ => 0.0,
        }
    }
}

/// A function of a base.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Form {
    Plain,
    Abs,
    Sign,
    Square,
    SignedSquare,
    Cube,
    AbsCube,
    Cos,
    Sin,
    CosTwice,
    SinTwice,
    Inverse,
}

/// A function of one base.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Factor(pub(crate) Base, pub(crate) Form);

impl Factor {
    fn degree(self) -> usize {
        match self.1 {
            Form::Square | Form::SignedSquare | Form::CosTwice | Form::SinTwice => 2,
            Form::Cube | Form::AbsCube => 3,
            _ => 1,
        }
    }

    fn power(self) -> i8 {
        match self.1 {
            Form::Plain | Form::Abs => 1,
            Form::Square | Form::SignedSquare => 2,
            Form::Cube | Form::AbsCube => 3,
            Form::Inverse => -1,
            Form::Sign | Form::Cos | Form::Sin | Form::CosTwice | Form::SinTwice => 0,
        }
    }

    pub(crate) fn value(self, at: &Instant) -> f64 {
        let z = at.get(self.0);
        match self.1 {
            Form::Plain => z,
            Form::Abs => z.abs(),
            Form::Sign if z.abs() <= self.0.least() => 0.0,
            Form::Sign => z.signum(),
            Form::Square => z * z,
            Form::SignedSquare => z * z.abs(),
            Form::Cube => z * z * z,
            Form::AbsCube => (z * z * z).abs(),
            Form::Cos => at.circle(self.0)[0],
            Form::Sin => at.circle(self.0)[1],
            Form::CosTwice => {
                let [cos, sin] = at.circle(self.0);
                cos * cos - sin * sin
            }
            Form::SinTwice => {
                let [cos, sin] = at.circle(self.0);
                2.0 * cos * sin
            }
            Form::Inverse => 1.0 / z.max(0.1),
        }
    }

    fn text(self) -> String {
        let (name, _) = self.0.symbol();
        let signed = if name.contains('/') { format!("({name})") } else { name.to_owned() };
        match self.1 {
            Form::Plain => name.to_owned(),
            Form::Abs => format!("|{name}|"),
            Form::Sign => format!("sign({name})"),
            Form::Square => format!("{signed}^2"),
            Form::SignedSquare => format!("{name} |{name}|"),
            Form::Cube => format!("{signed}^3"),
            Form::AbsCube => format!("|{name}|^3"),
            Form::Cos => format!("cos({name})"),
            Form::Sin => format!("sin({name})"),
            Form::CosTwice => format!("cos(2 {name})"),
            Form::SinTwice => format!("sin(2 {name})"),
            Form::Inverse => format!("1/{name}"),
        }
    }
}

/// A product of factors; of none, one.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Monomial(pub(crate) Vec<Factor>);

impl Monomial {
    pub(crate) fn degree(&self) -> usize {
        self.0.iter().map(|factor| factor.degree()).sum()
    }

    /// Whether a cosine or a sine is in it.
    pub(crate) fn has_circle(&self) -> bool {
        let circle = |form| matches!(form, Form::Cos | Form::Sin | Form::CosTwice | Form::SinTwice);
        self.0.iter().any(|factor| circle(factor.1))
    }

    /// Its value; 0 where a base is not known.
    pub(crate) fn value(&self, at: &Instant) -> f64 {
        let value: f64 = self.0.iter().map(|factor| factor.value(at)).product();
        if value.is_finite() { value } else { 0.0 }
    }

    pub(crate) fn text(&self) -> String {
        let texts: Vec<String> = self.0.iter().map(|factor| factor.text()).collect();
        if texts.is_empty() { "1".to_owned() } else { texts.join(" ") }
    }

    /// The unit of the coefficient that makes of it what has a unit of these powers of metre, second and radian.
    /// Radians are pure numbers but in what is an angle itself.
    pub(crate) fn coefficient_unit(&self, target: [i8; 3]) -> String {
        let mut powers = target;
        for factor in &self.0 {
            let (_, unit) = factor.0.symbol();
            for (power, own) in powers.iter_mut().zip(unit) {
                *power -= factor.power() * own;
            }
        }
        powers[2] = powers[2].max(0);
        unit(powers)
    }
}

/// `m/s`, `1/s`, `s^2/m`, `1`.
pub(crate) fn unit([metres, seconds, radians]: [i8; 3]) -> String {
    let all = [("m", metres), ("rad", radians), ("s", seconds)];
    let joined = |over: bool| {
        let mut text = String::new();
        for (name, power) in all.iter().filter(|(_, power)| if over { *power > 0 } else { *power < 0 }) {
            if !text.is_empty() {
                text.push(' ');
            }
            text.push_str(name);
            if power.abs() > 1 {
                let _ = write!(text, "^{}", power.abs());
            }
        }
        text
    };
    let (over, under) = (joined(true), joined(false));
    let over = if over.is_empty() { "1".to_owned() } else { over };
    match under.split(' ').count() {
        _ if under.is_empty() => over,
        1 => format!("{over}/{under}"),
        _ => format!("{over}/({under})"),
    }
}

const KINEMATIC: [Base; 4] = [Base::Speed, Base::YawRate, Base::Acceleration, Base::YawAcceleration];
const FIRST: [Form; 3] = [Form::Plain, Form::Abs, Form::Sign];
const SECOND: [Form; 2] = [Form::Square, Form::SignedSquare];
const THIRD: [Form; 2] = [Form::Cube, Form::AbsCube];

fn of(base: Base, forms: &[Form]) -> Vec<Monomial> {
    forms.iter().map(|&form| Monomial(vec![Factor(base, form)])).collect()
}

/// Products of one of each.
fn products(a: &[Monomial], b: &[Monomial]) -> Vec<Monomial> {
    let pairs = a.iter().flat_map(|a| b.iter().map(move |b| a.0.iter().chain(&b.0).copied().collect()));
    pairs.map(Monomial).collect()
}

/// Of several bases, by degree: those of the first, second and third.
fn powers(bases: &[Base], most: usize) -> Vec<Monomial> {
    let mut all = vec![Monomial(Vec::new())];
    for &base in bases {
        let own: Vec<Monomial> =
            [of(base, &FIRST), of(base, &SECOND), of(base, &THIRD)].into_iter().flatten().collect();
        let more = products(&all, &own);
        all.extend(more.into_iter().filter(|monomial| monomial.degree() <= most));
    }
    all.into_iter().filter(|monomial| monomial.degree() > 0).collect()
}

const CIRCLE: [Form; 2] = [Form::Cos, Form::Sin];
const TWICE: [Form; 2] = [Form::CosTwice, Form::SinTwice];

/// What a motion may be wrong by.
pub(crate) fn of_motion(wheels: bool) -> Vec<Monomial> {
    let mut all = vec![Monomial(Vec::new())];
    all.extend(powers(&KINEMATIC, 3));
    let (once, twice) = (powers(&KINEMATIC, 1), powers(&KINEMATIC, 2));
    let (heading, doubled) = (of(Base::Heading, &CIRCLE), of(Base::Heading, &TWICE));
    all.extend(heading.iter().cloned().chain(doubled.iter().cloned()));
    all.extend(products(&twice, &heading));
    all.extend(products(&once, &doubled));
    all.extend(places(&once));
    all.extend(products(&places(&[]), &heading).into_iter().filter(|own| own.degree() <= 2));
    if wheels {
        for wheel in [Base::LeftWheel, Base::RightWheel] {
            let circle = of(wheel, &CIRCLE);
            all.extend(circle.iter().cloned());
            all.extend(products(&once, &circle));
        }
    }
    all
}

/// Places alone up to the second degree, and with others in the first.
fn places(others: &[Monomial]) -> Vec<Monomial> {
    let first = [Base::X, Base::Y].map(|base| of(base, &[Form::Plain])).concat();
    let squares = [Base::X, Base::Y].map(|base| of(base, &[Form::Square])).concat();
    let mut all = first.clone();
    all.extend(squares);
    all.extend(products(&first[..1], &first[1..]));
    all.extend(products(others, &first));
    all
}

/// What a reading may be wrong by that says nothing of a target.
pub(crate) fn of_reading() -> Vec<Monomial> {
    let kinematic = [Base::Speed, Base::YawRate, Base::Acceleration];
    let mut all = vec![Monomial(Vec::new())];
    all.extend(powers(&kinematic, 2));
    let circle = of(Base::Heading, &CIRCLE);
    all.extend(circle.iter().cloned().chain(of(Base::Heading, &TWICE)));
    all.extend(products(&powers(&kinematic, 1), &circle));
    all.extend(places(&[]));
    all
}

/// What a sighting may be wrong by.
pub(crate) fn of_sighting() -> Vec<Monomial> {
    let mut all = of_reading();
    let seen = powers(&[Base::Bearing], 3);
    let ranges: Vec<Monomial> = of(Base::Range, &[Form::Plain, Form::Square, Form::Cube, Form::Inverse]);
    let aspect = of(Base::Bearing, &CIRCLE);
    let moving = powers(&[Base::Speed, Base::YawRate], 1);
    let both: Vec<Monomial> = products(&ranges, &seen).into_iter().filter(|own| own.degree() <= 3).collect();
    all.extend(seen.iter().cloned().chain(ranges.iter().cloned()).chain(aspect.iter().cloned()).chain(both));
    for own in [&ranges[..1], &ranges[3..], &aspect, &seen[..3]] {
        all.extend(products(&moving, own));
    }
    all.extend(products(&ranges[3..], &aspect));
    all.extend(products(&products(&moving[..1], &aspect), &ranges[3..]));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(text: &str, all: &[Monomial]) -> Monomial {
        all.iter().find(|own| own.text() == text).cloned().unwrap_or_else(|| panic!("no {text}"))
    }

    #[test]
    fn the_unit_of_a_coefficient_follows_from_what_it_multiplies() {
        let (velocity, rate, angle) = ([1, -1, 0], [0, -1, 1], [0, 0, 1]);
        let motion = of_motion(true);
        let cases = [
            ("v w", velocity, "s"),
            ("sign(v)", rate, "rad/s"),
            ("v |w|", velocity, "s"),
            ("v |v|", velocity, "s/m"),
            ("a", velocity, "s"),
            ("w", velocity, "m"),
            ("1", velocity, "m/s"),
            ("v", rate, "rad/m"),
            ("w", rate, "1"),
            ("v^2 w", rate, "s^2/m^2"),
            ("cos(heading)", velocity, "m/s"),
            ("(dw/dt)^2", velocity, "m s^3"),
        ];
        for (text, target, expected) in cases {
            let own = named(text, &motion);
            assert_eq!(own.coefficient_unit(target), expected, "{text}");
        }
        let sighting = of_sighting();
        assert_eq!(named("b^3", &sighting).coefficient_unit(angle), "1");
        assert_eq!(named("r", &sighting).coefficient_unit([1, 0, 0]), "1");
        assert_eq!(named("b^2", &sighting).coefficient_unit([1, 0, 0]), "m");
        assert_eq!(unit([-1, -2, 0]), "1/(m s^2)");
    }

    #[test]
    fn no_monomial_is_there_twice_or_of_more_than_the_third_degree() {
        for all in [of_motion(true), of_reading(), of_sighting()] {
            let mut sorted = all.clone();
            sorted.sort();
            sorted.dedup();
            assert_eq!(sorted.len(), all.len());
            assert!(all.iter().all(|own| own.degree() <= 3), "degree");
        }
    }

    #[test]
    fn what_is_not_known_adds_nothing_and_noise_has_no_sign() {
        let at = Instant::of(&[(Base::Speed, 0.004)]);
        let motion = of_motion(false);
        assert!(named("sign(v)", &motion).value(&at).abs() < 1e-12);
        assert!(named("cos(heading)", &motion).value(&at).abs() < 1e-12);
        let at = Instant::of(&[(Base::Speed, -0.5), (Base::Heading, 0.3)]);
        assert!((named("cos(2 heading)", &motion).value(&at) - 0.6_f64.cos()).abs() < 1e-12);
        assert!((named("sin(2 heading)", &motion).value(&at) - 0.6_f64.sin()).abs() < 1e-12);
        assert!((named("v |v|", &motion).value(&at) + 0.25).abs() < 1e-12);
    }
}
