//! The search for forms in what one robot's residuals leave, and for curves where forms do not suffice.

use std::collections::{BTreeMap, BTreeSet};

use crate::diagnosis::open::bench::{Bench, Score, Together};
use crate::diagnosis::open::monomial::{Base, Instant, Monomial, of_motion, of_reading, of_sighting};
use crate::diagnosis::open::motion::{Grain, Motions, Table};
use crate::diagnosis::open::picture::{Folds, Picture};
use crate::diagnosis::open::spline::Basis;
use crate::diagnosis::open::target::{Function, Target};
use crate::diagnosis::select::{FAMILYWISE, LEAST_GAIN};
use crate::diagnosis::support::ODDS;
use crate::diagnosis::term::Term;
use crate::diagnosis::unit::{Column, Unit};

/// The most forms that one target has, and one robot.
pub(crate) const MOST: usize = 2;
const MOST_OF_ROBOT: usize = 8;
/// A form that is this likely without it beside the others is dropped.
const PRUNE: f64 = 1e-4;
/// So many equivalent forms are told.
const TOLD: usize = 6;
/// In long steps this share of a gain makes a closer look worth it, and as many times the probability.
const CLOSER: f64 = 0.4;
const LENIENT: f64 = 1e3;
/// Standard errors by which a size must exceed what is harmless.
const NEAR_END: f64 = 3.0;

/// A form that was found.
#[derive(Clone, Debug)]
pub(crate) struct Form {
    pub(crate) target: Target,
    pub(crate) monomial: Monomial,
    pub(crate) columns: Vec<Column>,
    /// Forms that explain it about as well on these data.
    pub(crate) equivalent: Vec<Monomial>,
    pub(crate) inflation: f64,
}

/// A curve that was found.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    pub(crate) target: Target,
    pub(crate) regressor: Base,
    pub(crate) basis: Basis,
    /// Positions of the knots whose functions are there, with their columns by unit.
    pub(crate) columns: Knots,
    pub(crate) p: f64,
    pub(crate) gain: f64,
    pub(crate) inflation: f64,
}

/// Knots with the columns of their functions by unit.
type Knots = Vec<(usize, Vec<Column>)>;

/// What is looked for in one robot.
pub(crate) struct Ground<'u, 'a> {
    pub(crate) units: Vec<&'u Unit<'a>>,
    pub(crate) motions: Vec<Motions>,
    /// In long steps.
    coarse: Vec<Motions>,
    pub(crate) targets: Vec<Target>,
    dictionaries: BTreeMap<Target, Vec<Monomial>>,
}

impl<'u, 'a> Ground<'u, 'a> {
    pub(crate) fn new(units: Vec<&'u Unit<'a>>, terms: &[Term], skipped: &[Target]) -> Self {
        let recorded = |target: &Target| units.iter().any(|unit| target.is_recorded(unit));
        let targets: Vec<Target> =
            Target::ALL.into_iter().filter(|own| recorded(own) && !skipped.contains(own)).collect();
        let motions = |grain: Grain| units.iter().map(|unit| Motions::new(unit, terms, grain)).collect();
        let (motions, coarse) = (motions(Grain::FINE), motions(Grain::COARSE));
        let wheels = units.iter().all(|unit| {
            unit.evidence.prepared(unit.robot()).is_some_and(|(track, _)| !track.encoders.is_empty())
        });
        let dictionary = |target: &Target| match target {
            Target::SetSpeed | Target::SetYawRate => of_motion(false),
            Target::Forward | Target::Left | Target::YawRate | Target::Gyro => of_motion(wheels),
            Target::GpsForward | Target::GpsLeft | Target::Heading => of_reading(),
            Target::Range | Target::Bearing => of_sighting(),
        };
        let dictionaries = targets.iter().map(|target| (*target, dictionary(target))).collect();
        Self { units, motions, coarse, targets, dictionaries }
    }

    /// How many forms and curves are tried.
    pub(crate) fn tests(&self) -> usize {
        self.dictionaries.iter().map(|(target, all)| all.len() + target.regressors().len()).sum()
    }

    /// What a form of this degree costs, twice in log-likelihood: there are so many of them.
    pub(crate) fn price(&self, target: Target, monomial: &Monomial) -> f64 {
        let degree = monomial.degree();
        let alike = self
            .dictionaries
            .get(&target)
            .map_or(1, |all| all.iter().filter(|other| other.degree() <= degree).count());
        2.0 * (alike.max(1) as f64).ln()
    }

    pub(crate) fn columns(&self, target: Target, function: &Function<'_>) -> Vec<Column> {
        self.columns_in(&self.motions, target, function)
    }

    fn columns_in(&self, motions: &[Motions], target: Target, function: &Function<'_>) -> Vec<Column> {
        let own = |(unit, motions): (&&Unit<'_>, &Motions)| target.column(unit, motions, function);
        self.units.iter().zip(motions).map(own).collect()
    }

    /// The columns of monomials, in their order.
    fn columns_of<'m>(
        &'m self,
        motions: &'m [Motions],
        target: Target,
        monomials: &'m [&'m Monomial],
    ) -> impl Iterator<Item = (&'m Monomial, Vec<Column>)> {
        let both = move || self.units.iter().zip(motions);
        let table = |(unit, motions): (&&Unit<'_>, &Motions)| Table::new(unit, motions, target, monomials);
        let tables: Vec<Table> = both().map(table).collect();
        monomials.iter().map(move |&monomial| {
            let column = |((unit, motions), table): ((&&Unit<'_>, &Motions), &Table)| {
                target.gathered(unit, motions, &|which| table.values(which, monomial))
            };
            (monomial, both().zip(&tables).map(column).collect())
        })
    }

    /// The monomials that are worth a closer look.
    fn promising(&self, bench: &Bench, target: Target, tests: usize) -> Vec<&Monomial> {
        let all: Vec<&Monomial> = self.dictionaries[&target].iter().collect();
        let scored = self.columns_of(&self.coarse, target, &all).filter_map(|(monomial, columns)| {
            let score = bench.score(&columns, CLOSER * LEAST_GAIN)?;
            let clear = score.p * tests as f64 <= LENIENT * FAMILYWISE;
            (clear && score.deflated() > CLOSER * LEAST_GAIN).then(|| (monomial.clone(), score.deflated()))
        });
        let scored: Vec<(Monomial, f64)> = scored.collect();
        let most = scored.iter().map(|(_, gain)| *gain).fold(0.0, f64::max);
        let near =
            |own: &&Monomial| scored.iter().any(|(monomial, gain)| monomial == *own && *gain > CLOSER * most);
        self.dictionaries[&target].iter().filter(near).collect()
    }

    /// The root mean square of columns in the component that shows the target most.
    pub(crate) fn size(&self, target: Target, columns: &[Column]) -> f64 {
        self.product(target, columns, columns).sqrt()
    }

    /// The mean product of columns in that component.
    fn product(&self, target: Target, a: &[Column], b: &[Column]) -> f64 {
        let (mut sum, mut count) = (0.0, 0_usize);
        for ((unit, a), b) in self.units.iter().zip(a).zip(b) {
            let Some((which, component)) = target.main(unit) else { continue };
            let stretch = &unit.stretches[which];
            count += stretch.rows;
            if let (Some(a), Some(b)) = (&a.parts[which], &b.parts[which]) {
                let each = a.iter().zip(b).skip(component).step_by(stretch.components);
                sum += each.map(|(a, b)| a * b).sum::<f64>();
            }
        }
        sum / count.max(1) as f64
    }

    /// What does not matter in a target.
    pub(crate) fn harmless(&self, target: Target) -> Vec<Vec<Column>> {
        let Some(unit) = self.units.first() else { return Vec::new() };
        let of = |(coefficient, monomial): &(f64, Monomial)| {
            self.columns(target, &|at| coefficient * monomial.value(at))
        };
        target.harmless(unit).iter().map(of).collect()
    }

    /// The greatest size in the direction of columns that does not matter: what a harmless effect has of it, and
    /// the least of the harmless in any direction.
    pub(crate) fn bound(&self, target: Target, harmless: &[Vec<Column>], columns: &[Column]) -> f64 {
        let size = self.size(target, columns).max(f64::MIN_POSITIVE);
        let along = |own: &Vec<Column>| (self.product(target, own, columns) / size).abs();
        let least = harmless.iter().map(|own| self.size(target, own)).fold(f64::INFINITY, f64::min);
        harmless.iter().map(along).fold(least, f64::max)
    }

    fn matters(&self, target: Target, columns: &[Column], score: &Score, harmless: &[Vec<Column>]) -> bool {
        let size = (score.change.abs() - NEAR_END * score.error) * self.size(target, columns);
        size > 0.0 && size > self.bound(target, harmless, columns)
    }

    /// The best form of all targets that may have one more.
    fn best(&self, picture: &Picture<'_, '_>, closed: &BTreeSet<Target>, tests: usize) -> Option<Form> {
        let mut best: Option<(f64, Form)> = None;
        for &target in &self.targets {
            if closed.contains(&target) {
                continue;
            }
            let Some(bench) = Bench::new(picture, target) else { continue };
            let harmless = self.harmless(target);
            let mut scored: Vec<(f64, &Monomial, Vec<Column>, f64)> = Vec::new();
            let mut alike: Vec<(f64, &Monomial)> = Vec::new();
            let monomials = self.promising(&bench, target, tests);
            for (monomial, columns) in self.columns_of(&self.motions, target, &monomials) {
                let Some(score) = bench.score(&columns, CLOSER * LEAST_GAIN) else { continue };
                let worth = score.deflated() - self.price(target, monomial);
                alike.push((worth, monomial));
                let clear = score.p * tests as f64 <= FAMILYWISE && score.deflated() > LEAST_GAIN;
                if clear && self.matters(target, &columns, &score, &harmless) {
                    scored.push((worth, monomial, columns, score.inflation));
                }
            }
            let first = scored.into_iter().reduce(|a, b| if b.0 > a.0 { b } else { a });
            let Some((worth, monomial, columns, inflation)) = first else { continue };
            if best.as_ref().is_some_and(|(most, _)| *most >= worth) {
                continue;
            }
            alike.retain(|(own, other)| *own > worth - ODDS && *other != monomial);
            alike.sort_by(|a, b| b.0.total_cmp(&a.0));
            let equivalent = alike.into_iter().take(TOLD).map(|(_, other)| other.clone()).collect();
            let monomial = monomial.clone();
            best = Some((worth, Form { target, monomial, columns, equivalent, inflation }));
        }
        best.map(|(_, form)| form)
    }

    /// Adds forms as long as one is significant; drops those that no longer are. With the targets that would need
    /// more than they may have.
    pub(crate) fn forms<'p>(&self, base: &Picture<'p, 'a>, tests: usize) -> (Vec<Form>, BTreeSet<Target>) {
        let mut short = BTreeSet::new();
        let mut forms: Vec<Form> = Vec::new();
        let mut picture = base.clone();
        for _ in 0..2 * MOST_OF_ROBOT {
            if forms.len() >= MOST_OF_ROBOT {
                break;
            }
            let Some(form) = self.best(&picture, &short, tests) else { break };
            if forms.iter().filter(|own| own.target == form.target).count() >= MOST {
                short.insert(form.target);
                continue;
            }
            picture = picture.with(std::slice::from_ref(&form.columns));
            forms.push(form);
            while let Some(weakest) = Self::weakest(&picture, &forms) {
                picture = picture.without(&[picture.size() - forms.len() + weakest]);
                let dropped = forms.remove(weakest);
                if weakest == forms.len() {
                    // The last one added: there is no more to gain.
                    drop(dropped);
                    return (forms, short);
                }
            }
        }
        (forms, short)
    }

    /// The form that is least needed beside the others, if it is not needed.
    fn weakest(picture: &Picture<'_, '_>, forms: &[Form]) -> Option<usize> {
        let p = |position: usize| Self::beside(picture, forms, position).map_or(1.0, |score| score.p);
        let all = (0..forms.len()).map(|position| (p(position), position));
        all.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(p, _)| *p > PRUNE).map(|(_, position)| position)
    }

    /// What a form gains beside everything else.
    pub(crate) fn beside(picture: &Picture<'_, '_>, forms: &[Form], position: usize) -> Option<Score> {
        let form = &forms[position];
        let without = picture.without(&[picture.size() - forms.len() + position]);
        // Noise is that of the whole: what the form explains is not noise.
        let mut without = without;
        for (own, whole) in without.states.iter_mut().zip(&picture.states) {
            own.noise = whole.noise.clone();
        }
        Bench::new(&without, form.target)?.score(&form.columns, 0.0)
    }

    /// Two forms of what a rest depends on that together do better than the forms of its target in a picture.
    pub(crate) fn pair(
        &self,
        bare: &Picture<'_, 'a>,
        picture: &Picture<'_, 'a>,
        rest: &Curve,
    ) -> Option<Vec<Form>> {
        let target = rest.target;
        let of_rest = |own: &&Monomial| own.0.iter().all(|factor| factor.0 == rest.regressor);
        let alone: Vec<(&Monomial, Vec<Column>)> = self.dictionaries[&target]
            .iter()
            .filter(of_rest)
            .map(|own| (own, self.columns(target, &|at| own.value(at))))
            .collect();
        let mut best = (picture.log_likelihood() + 0.5 * LEAST_GAIN * rest.inflation.max(1.0), None);
        for (second, b) in alone.iter().enumerate() {
            for (first, a) in alone.iter().enumerate().take(second) {
                // Of pairs that do as well, powers rather than circles: `b` and `b^3`, not `b` and `sin(b)`.
                let circles = [a.0, b.0].iter().filter(|own| own.has_circle()).count();
                let reached = bare.with(&[a.1.clone(), b.1.clone()]).log_likelihood()
                    - 0.5 * ODDS * rest.inflation.max(1.0) * circles as f64;
                if reached > best.0 {
                    best = (reached, Some([first, second]));
                }
            }
        }
        let form = |position: usize| {
            let (monomial, columns) = alone[position].clone();
            let (monomial, equivalent) = (monomial.clone(), Vec::new());
            Form { target, monomial, columns, equivalent, inflation: rest.inflation }
        };
        best.1.map(|pair| pair.map(form).to_vec())
    }

    /// The columns of a curve, and what it would gain.
    fn curved(
        &self,
        bench: &Bench,
        target: Target,
        (regressor, basis): (Base, &Basis),
        motions: &[Motions],
    ) -> Option<(Knots, Together)> {
        let mut all: Knots = (0..basis.knots.len()).map(|knot| (knot, Vec::new())).collect();
        for (unit, motions) in self.units.iter().zip(motions) {
            let at = |which: usize| motions.samples(unit, which).iter().map(|at| at.get(regressor));
            let values: BTreeMap<usize, Vec<Vec<f64>>> =
                target.shown(unit).into_iter().map(|which| (which, basis.values(at(which)))).collect();
            for (knot, columns) in &mut all {
                columns.push(target.gathered(unit, motions, &|which| values[&which][*knot].clone()));
            }
        }
        // Beside a constant that is fitted the height of the curve says nothing: it is zero in the middle.
        let middle = basis.knots.len() / 2;
        let bent: Knots = all.iter().filter(|(knot, _)| *knot != middle).cloned().collect();
        let score = |own: &[(usize, Vec<Column>)]| {
            let columns: Vec<Vec<Column>> = own.iter().map(|(_, columns)| columns.clone()).collect();
            bench.score_together(&columns, CLOSER * LEAST_GAIN)
        };
        score(&all).map(|own| (all, own)).or_else(|| score(&bent).map(|own| (bent, own)))
    }

    /// The best curve of a target beside a picture.
    pub(crate) fn curve(&self, picture: &Picture<'_, '_>, target: Target, tests: usize) -> Option<Curve> {
        let bench = Bench::new(picture, target)?;
        let instants: Vec<Vec<Instant>> = self
            .units
            .iter()
            .zip(&self.motions)
            .map(|(unit, motions)| target.instants(unit, motions))
            .collect();
        let rows: usize = instants.iter().map(Vec::len).sum();
        let mut best: Option<(f64, Curve)> = None;
        for &regressor in target.regressors() {
            let values: Vec<f64> = instants.iter().flatten().map(|at| at.get(regressor)).collect();
            let Some(basis) = Basis::new(&values) else { continue };
            let (lenient, closer) = (LENIENT * FAMILYWISE, CLOSER * LEAST_GAIN);
            let worth_it = self
                .curved(&bench, target, (regressor, &basis), &self.coarse)
                .is_some_and(|(_, found)| found.p * tests as f64 <= lenient && found.deflated() > closer);
            if !worth_it {
                continue;
            }
            let Some((columns, found)) = self.curved(&bench, target, (regressor, &basis), &self.motions)
            else {
                continue;
            };
            if found.p * tests as f64 > FAMILYWISE || found.deflated() <= LEAST_GAIN {
                continue;
            }
            let worth = found.deflated() - columns.len() as f64 * (rows.max(2) as f64).ln();
            if best.as_ref().is_none_or(|(most, _)| worth > *most) {
                let (p, gain, inflation) = (found.p, found.deflated(), found.inflation);
                best = Some((worth, Curve { target, regressor, basis, columns, p, gain, inflation }));
            }
        }
        best.map(|(_, curve)| curve)
    }
}

impl Curve {
    /// How data are left out to see whether it holds there.
    pub(crate) fn folds(&self) -> Folds {
        if self.regressor == Base::Time { Folds::Turns } else { Folds::Spans }
    }

    pub(crate) fn all_columns(&self) -> Vec<Vec<Column>> {
        self.columns.iter().map(|(_, columns)| columns.clone()).collect()
    }
}
