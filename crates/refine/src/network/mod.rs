//! A network that proposes poses of an object from what is seen and felt of it, trained elsewhere: a PointNet as that of Dikhale et al. (2022).
//!
//! Each point's [numbers](CHANNELS) pass the layers `point`; the maximum over all points passes the layers `global`; both together pass the layers `vote`,
//! which give the point's vote for the pose. All but the last of `vote` end with a rectifier. Votes are gathered to hypotheses.
//!
//! Tensors of a safetensors file, all of 32-bit floats; numbers and widths of layers are free:
//!
//! | name | shape | meaning |
//! |---|---|---|
//! | `point.N.weight`, `point.N.bias` | \[outputs, inputs\], \[outputs\] | N = 0, 1, …; the first has [`CHANNELS`] inputs |
//! | `global.N.weight`, `global.N.bias` | the same | any number, also none; the first has the outputs of the last `point` as inputs |
//! | `vote.N.weight`, `vote.N.bias` | the same | inputs of the first: the outputs of the last `point` but one, then those of the last `global`; the last has [`VOTE`] outputs |
//! | `object.center` | \[3\] | center of the bounding box \[m\] |
//! | `object.radius` | \[1\] | half the diagonal of the bounding box \[m\] |
//! | `object.symmetries` | \[n, 3, 3\] | rotations about `object.center` that change nothing, the identity first |
//!
//! Points of a set are numbers of [`CHANNELS`], in axes whose z is the line of sight to the mean of the points that are seen, turned about it at will:
//!
//! | channels | number |
//! |---|---|
//! | 0 to 2 | position less that mean, over the radius; points beyond two radii of the median are left out |
//! | 3 to 5 | outward unit normal, of 20 neighbors; of a contact, against that of the skin; 0 if unknown |
//! | 6 to 8 | color over the root mean square of all colors, at most 3, less 0.5; 0 if unknown |
//! | 9 | 1 if the color is known |
//! | 10 to 12 | force of the object on the skin, f/(‖f‖ + 0.5 N), of taxels with more than 0.05 N; 0 if unknown |
//! | 13, 14 | 1 of a contact; 1 if its force is known |
//!
//! A vote is the center relative to the point in radii (3), the first two columns of the rotation object → network axes (6; orthonormalized by Gram and
//! Schmidt), and the logit of the confidence.

mod dense;
mod points;
mod settings;
mod tensors;
mod votes;

use std::path::{Path, PathBuf};

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

pub use self::points::{CHANNELS, SensedPoint, SensedPoints, ViewFrame};
pub use self::settings::NetworkSettings;
pub use self::tensors::{NetworkError, Tensor, Tensors, read_tensors, write_tensors};

use self::dense::{Dense, rectified, relu};
use self::votes::{Vote, VotedShape};
use crate::error::RefineError;
use crate::pose_finder::{PoseCandidate, PoseFinder};
use crate::scene::{Object, PreparedFrame};

/// Numbers of a vote.
pub const VOTE: usize = 10;

/// A trained network of one object.
#[derive(Clone, Debug)]
pub struct PoseNetwork {
    point: Vec<Dense>,
    global: Vec<Dense>,
    /// First layer of `vote` by its inputs: those of the point, and those of the whole.
    vote_first: [Dense; 2],
    vote_rest: Vec<Dense>,
    center: Point3<f64>,
    radius: f64,
    turns: Vec<UnitQuaternion<f64>>,
    settings: NetworkSettings,
}

impl PoseNetwork {
    /// Network of a safetensors file ([format](self)).
    ///
    /// # Errors
    /// [`NetworkError`] naming the file, and the tensor that is missing or wrong.
    pub fn load(file: &Path) -> Result<Self, NetworkError> {
        Self::from_tensors(file, read_tensors(file)?)
    }

    /// Network of the tensors of `file`.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn from_tensors(file: &Path, tensors: Tensors) -> Result<Self, NetworkError> {
        let mut source = NetworkSource { file: file.to_owned(), tensors };
        let numbers = source.take("object.center", &[Some(3)])?.values;
        let center = Point3::new(numbers[0], numbers[1], numbers[2]).cast();
        let radius = f64::from(source.take("object.radius", &[Some(1)])?.values[0]);
        if radius <= 0.0 {
            return Err(source.fault("object.radius", format!("is {radius} m")));
        }
        let rows = source.take("object.symmetries", &[None, Some(3), Some(3)])?.values;
        let turn = |m: &[f32; 9]| {
            let matrix: Matrix3<f64> = Matrix3::from_row_slice(m).cast();
            let is_rotation = (matrix * matrix.transpose() - Matrix3::identity()).amax() < 1e-3
                && matrix.determinant() > 0.0;
            is_rotation.then(|| UnitQuaternion::from_matrix(&matrix))
        };
        let turns: Option<Vec<_>> = rows.as_chunks().0.iter().map(turn).collect();
        let turns = turns.filter(|turns| !turns.is_empty());
        let wrong = || source.fault("object.symmetries", "must be rotations".into());
        let turns = turns.ok_or_else(wrong)?;
        let point = source.layers("point", CHANNELS)?;
        let [.., local, whole] = point.as_slice() else {
            return Err(source.fault("point.1.weight", "is missing".into()));
        };
        let (local, whole) = (local.bias.len(), whole.bias.len());
        let global = source.layers("global", whole)?;
        let whole = global.last().map_or(whole, |layer| layer.bias.len());
        let mut vote = source.layers("vote", local + whole)?;
        let outputs = vote.last().map_or(0, |layer| layer.bias.len());
        if vote.len() < 2 || outputs != VOTE {
            let name = format!("vote.{}.weight", vote.len().max(2) - 1);
            return Err(source.fault(&name, format!("must be the last, of {VOTE} outputs")));
        }
        let vote_rest = vote.split_off(1);
        let vote_first = vote[0].split(local);
        let settings = NetworkSettings::default();
        Ok(Self { point, global, vote_first, vote_rest, center, radius, turns, settings })
    }

    /// With these settings.
    ///
    /// # Errors
    /// [`RefineError::Setting`] for one out of range.
    pub fn with_settings(self, settings: NetworkSettings) -> Result<Self, RefineError> {
        settings.check()?;
        Ok(Self { settings, ..self })
    }

    /// Votes of `points` with such [features](ViewFrame::features): [`VOTE`] numbers for each of the first `voters` of every set.
    pub fn votes(&self, sets: &[&[[f32; CHANNELS]]], voters: usize) -> Vec<Vec<[f32; VOTE]>> {
        let all: Vec<f32> = sets.iter().flat_map(|set| set.iter().flatten().copied()).collect();
        let count = all.len() / CHANNELS;
        let Some((last, before)) = self.point.split_last() else { return Vec::new() };
        let local = rectified(before, DMatrix::from_vec(CHANNELS, count, all));
        let whole = relu(last.apply(&local));
        let mut greatest = DMatrix::zeros(whole.nrows(), sets.len());
        let mut voting = Vec::new();
        let mut start = 0;
        for (set, points) in sets.iter().enumerate() {
            for column in whole.columns(start, points.len()).column_iter() {
                let mut most = greatest.column_mut(set);
                most.zip_apply(&column, |m: &mut f32, v| *m = m.max(v));
            }
            voting.extend((start..start + voters.min(points.len())).map(|at| (set, at)));
            start += points.len();
        }
        let [of_point, of_whole] = &self.vote_first;
        let shared = of_whole.apply(&rectified(&self.global, greatest));
        let columns: Vec<usize> = voting.iter().map(|(_, at)| *at).collect();
        let mut mixed = of_point.apply(&local.select_columns(&columns));
        for (mut column, (set, _)) in mixed.column_iter_mut().zip(&voting) {
            column += shared.column(*set);
        }
        let mixed = relu(mixed);
        let Some((last, before)) = self.vote_rest.split_last() else { return Vec::new() };
        let outputs = last.apply(&rectified(before, mixed));
        let mut found = vec![Vec::new(); sets.len()];
        for (column, (set, _)) in outputs.column_iter().zip(&voting) {
            found[*set].push(std::array::from_fn(|k| column[k]));
        }
        found
    }

    /// Refuses an object that is not of the network's size.
    ///
    /// # Errors
    /// [`RefineError::Object`].
    pub fn check_object(&self, object: &Object) -> Result<(), RefineError> {
        let difference =
            (object.center - self.center).norm().max((object.radius - self.radius).abs());
        if difference <= self.settings.size_tolerance * self.radius {
            return Ok(());
        }
        let (own, other) = (1e3 * object.radius, 1e3 * self.radius);
        let reason = format!(
            "the network is of another one: radius {other:.1} mm, not {own:.1} mm, or another origin"
        );
        Err(RefineError::Object { object: object.name.clone(), reason })
    }

    /// Hypotheses by points that were taken from a frame; none if no vote counts.
    pub fn find_in(&self, points: &SensedPoints) -> Vec<PoseCandidate> {
        let &NetworkSettings { seen, felt, voters, rolls, .. } = &self.settings;
        let (seen, felt) = (spread(&points.seen, seen), spread(&points.felt, felt));
        // Points that vote come first.
        let share = (voters * felt.len()).div_ceil((felt.len() + seen.len()).max(1));
        let mut chosen = spread(&felt, share);
        chosen.extend(spread(&seen, voters - share.min(voters)));
        let voters = chosen.len();
        chosen.extend(felt.iter().chain(&seen));
        let roll = |k: usize| std::f64::consts::TAU * k as f64 / rolls as f64;
        let view = |k: usize| ViewFrame::new(&points.seen, self.radius, roll(k));
        let views: Vec<ViewFrame> = (0..rolls).map(view).collect();
        let of_view = |view: &ViewFrame| chosen.iter().map(|p| view.features(p)).collect();
        let sets: Vec<Vec<[f32; CHANNELS]>> = views.iter().map(of_view).collect();
        let slices: Vec<&[[f32; CHANNELS]]> = sets.iter().map(Vec::as_slice).collect();
        let mut votes = Vec::new();
        for ((view, set), outputs) in views.iter().zip(&sets).zip(self.votes(&slices, voters)) {
            votes.extend(set.iter().zip(&outputs).filter_map(|(p, vote)| self.vote(view, p, vote)));
        }
        self.shape().gathered(votes, &self.settings)
    }

    /// Angle between two rotations of the object, turns that change nothing apart \[rad\].
    pub fn angle(&self, a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
        self.shape().difference(a, b).angle
    }

    fn shape(&self) -> VotedShape<'_> {
        VotedShape { center: &self.center, radius: self.radius, turns: &self.turns }
    }

    /// The vote of a point for a pose; none if it makes no rotation.
    fn vote(&self, view: &ViewFrame, point: &[f32; CHANNELS], vote: &[f32; VOTE]) -> Option<Vote> {
        let [x, y, z, ..] = *point;
        let [dx, dy, dz, ax, ay, az, bx, by, bz, logit] = *vote;
        let position = Vector3::new(x + dx, y + dy, z + dz).cast();
        let first = Vector3::new(ax, ay, az).cast::<f64>().try_normalize(1e-9)?;
        let second = Vector3::new(bx, by, bz).cast::<f64>();
        let second = (second - first * first.dot(&second)).try_normalize(1e-9)?;
        let columns = Matrix3::from_columns(&[first, second, first.cross(&second)]);
        let rotation = Rotation3::from_matrix_unchecked(columns);
        let pose = view.pose(&self.center, &position, &UnitQuaternion::from(rotation));
        let weight = 1.0 / (1.0 + f64::from(-logit).exp());
        let is_finite = weight.is_finite() && position.iter().all(|v: &f64| v.is_finite());
        is_finite.then_some(Vote { pose, weight })
    }
}

impl PoseFinder for PoseNetwork {
    /// Poses by depth, and by color and touch where they are known; weights are shares of the votes.
    ///
    /// # Errors
    /// [`RefineError::Object`] if the frame is of an object of another size; if no pixel of the mask has a depth, or forces do not fit the taxels.
    fn find(&self, frame: &PreparedFrame<'_>) -> Result<Vec<PoseCandidate>, RefineError> {
        self.check_object(frame.object())?;
        let found = self.find_in(&SensedPoints::new(frame, self.radius)?);
        if found.is_empty() { Err(RefineError::NothingFits) } else { Ok(found) }
    }
}

/// Some `limit` of `items`, spread evenly.
fn spread<T: Copy>(items: &[T], limit: usize) -> Vec<T> {
    let count = items.len().min(limit);
    (0..count).map(|k| items[(2 * k + 1) * items.len() / (2 * count)]).collect()
}

/// Tensors of a file, to be taken one after the other.
struct NetworkSource {
    file: PathBuf,
    tensors: Tensors,
}

impl NetworkSource {
    fn fault(&self, name: &str, problem: String) -> NetworkError {
        NetworkError::new(&self.file, format!("tensor {name}: {problem}"))
    }

    /// The tensor of that name, with these dimensions where they are known.
    fn take(&mut self, name: &str, expected: &[Option<usize>]) -> Result<Tensor, NetworkError> {
        let found = self.tensors.remove(name);
        let tensor = found.ok_or_else(|| self.fault(name, "is missing".into()))?;
        let fits = tensor.shape.len() == expected.len()
            && tensor.shape.iter().zip(expected).all(|(n, e)| e.is_none_or(|e| e == *n));
        if fits {
            return Ok(tensor);
        }
        let dimension = |e: &Option<usize>| e.map_or("n".to_owned(), |e| e.to_string());
        let expected: Vec<String> = expected.iter().map(dimension).collect();
        let (shape, expected) = (&tensor.shape, expected.join(", "));
        Err(self.fault(name, format!("has the shape {shape:?}, must have [{expected}]")))
    }

    /// Layers `name.0`, `name.1`, …, the first of which has that number of inputs.
    fn layers(&mut self, name: &str, mut inputs: usize) -> Result<Vec<Dense>, NetworkError> {
        let mut layers = Vec::new();
        loop {
            let [weight, bias] =
                ["weight", "bias"].map(|part| format!("{name}.{}.{part}", layers.len()));
            if !self.tensors.contains_key(&weight) {
                return Ok(layers);
            }
            let Tensor { shape, values } = self.take(&weight, &[None, Some(inputs)])?;
            let outputs = shape[0];
            let weight = DMatrix::from_row_slice(outputs, inputs, &values);
            let bias = DVector::from_vec(self.take(&bias, &[Some(outputs)])?.values);
            layers.push(Dense { weight, bias });
            inputs = outputs;
        }
    }
}

#[cfg(test)]
mod tests;
