//! Recorded tosses: reading and writing them.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

use anyhow::Context;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use prehend::autodiff::Scalar;
use prehend::autodiff::lie::{lift, so3_log};
use prehend::sim::BodyState;
use serde::{Deserialize, Serialize};

/// Rows a second.
pub(crate) const RATE: f64 = 148.0;

/// How far from its time a row may be, in intervals between rows.
const LATE: f64 = 0.5;

/// A row of a recording: position \[m\], attitude, velocity \[m/s\] and spin along the cube's axes \[rad/s\].
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
pub(crate) struct Row {
    pub(crate) toss_id: u32,
    /// Starts have none.
    pub(crate) t: Option<f64>,
    px: f64,
    py: f64,
    pz: f64,
    qw: f64,
    qx: f64,
    qy: f64,
    qz: f64,
    vx: f64,
    vy: f64,
    vz: f64,
    wx: f64,
    wy: f64,
    wz: f64,
}

/// How a toss begins.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start<S: Scalar = f64> {
    /// Pose of the cube \[m\].
    pub(crate) pose: Isometry3<S>,
    /// Velocity of the cube's center \[m/s\].
    pub(crate) velocity: Vector3<S>,
    /// Along the cube's axes \[rad/s\].
    pub(crate) spin: Vector3<S>,
}

impl<S: Scalar> Start<S> {
    /// Values without derivatives.
    pub(crate) fn value(&self) -> Start {
        let state =
            BodyState { pose: self.pose, linear: self.velocity, angular: self.spin }.value();
        Start { pose: state.pose, velocity: state.linear, spin: state.angular }
    }
}

impl Start {
    /// Constants of another scalar.
    pub(crate) fn cast<S: Scalar>(&self) -> Start<S> {
        let [velocity, spin] = [self.velocity, self.spin].map(|v| v.map(S::constant));
        Start { pose: lift(&self.pose), velocity, spin }
    }
}

/// Rows of one toss.
pub(crate) struct Toss {
    pub(crate) id: u32,
    pub(crate) rows: Vec<Row>,
}

impl Row {
    pub(crate) fn pose(&self) -> Isometry3<f64> {
        let rotation = Quaternion::new(self.qw, self.qx, self.qy, self.qz);
        let place = Translation3::new(self.px, self.py, self.pz);
        Isometry3::from_parts(place, UnitQuaternion::from_quaternion(rotation))
    }

    /// The vertical, along the cube's axes.
    pub(crate) fn up(&self) -> Vector3<f64> {
        self.pose().rotation.inverse() * Vector3::z()
    }

    /// The state of this row.
    fn state(&self) -> Start {
        let velocity = Vector3::new(self.vx, self.vy, self.vz);
        let spin = Vector3::new(self.wx, self.wy, self.wz);
        Start { pose: self.pose(), velocity, spin }
    }

    /// The state of this row, whose velocity is the mean of the interval before under `gravity` \[m/s²\].
    pub(crate) fn start(&self, gravity: f64) -> Start {
        let mut start = self.state();
        start.velocity.z -= 0.5 * gravity / RATE;
        start
    }

    /// From this row to `pose`: position and rotation vector, times `scales` \[1/m, 1/rad\].
    pub(crate) fn to<S: Scalar>(&self, pose: &Isometry3<S>, scales: [f64; 2]) -> [S; 6] {
        let seen = lift::<S>(&self.pose());
        let place = pose.translation.vector - seen.translation.vector;
        let turn = so3_log(&(pose.rotation * seen.rotation.inverse()));
        let [place, turn] = [place.map(|x| x.times(scales[0])), turn.map(|x| x.times(scales[1]))];
        [place.x, place.y, place.z, turn.x, turn.y, turn.z]
    }

    /// A predicted row.
    pub(crate) fn predicted(
        toss_id: u32,
        t: Option<f64>,
        pose: &Isometry3<f64>,
        velocity: Vector3<f64>,
        spin: Vector3<f64>,
    ) -> Self {
        let (p, q) = (pose.translation.vector, pose.rotation);
        let [vx, vy, vz] = velocity.into();
        let [wx, wy, wz] = spin.into();
        Self {
            toss_id,
            t,
            px: p.x,
            py: p.y,
            pz: p.z,
            qw: q.w,
            qx: q.i,
            qy: q.j,
            qz: q.k,
            vx,
            vy,
            vz,
            wx,
            wy,
            wz,
        }
    }
}

/// All tosses of a file.
pub(crate) fn read(file: &Path) -> anyhow::Result<Vec<Toss>> {
    let mut tosses: BTreeMap<u32, Vec<Row>> = BTreeMap::new();
    let mut reader = csv::Reader::from_path(file).with_context(|| file.display().to_string())?;
    for (line, row) in reader.deserialize().enumerate() {
        let place = || format!("{}, row {}", file.display(), line + 1);
        let row: Row = row.with_context(place)?;
        row.t.context("no t").with_context(place)?;
        tosses.entry(row.toss_id).or_default().push(row);
    }
    anyhow::ensure!(!tosses.is_empty(), "{}: no rows", file.display());
    for (id, rows) in &tosses {
        let late = |(k, row): &(usize, &Row)| {
            (row.t.zip(rows[0].t))
                .is_none_or(|(t, start)| (RATE * (t - start) - *k as f64).abs() > LATE)
        };
        if let Some((k, _)) = rows.iter().enumerate().find(late) {
            anyhow::bail!(
                "{}: row {} of toss {id} is not {k}/{RATE} s after its first",
                file.display(),
                k + 1
            );
        }
    }
    Ok(tosses.into_iter().map(|(id, rows)| Toss { id, rows }).collect())
}

/// All starts of a file.
pub(crate) fn read_starts(file: &Path) -> anyhow::Result<BTreeMap<u32, Start>> {
    let mut reader = csv::Reader::from_path(file).with_context(|| file.display().to_string())?;
    let rows = reader.deserialize().map(|row| {
        let row: Row = row?;
        Ok((row.toss_id, row.state()))
    });
    rows.collect::<Result<_, csv::Error>>().with_context(|| file.display().to_string())
}

/// Writes rows: all, or none.
pub(crate) fn write(file: &Path, rows: &[Row]) -> anyhow::Result<()> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    rows.iter().try_for_each(|row| writer.serialize(row))?;
    std::fs::write(file, writer.into_inner()?).with_context(|| file.display().to_string())
}

/// The ids that a fit leaves out: `dev100` of the `subsets.json` beside `file`, if there is one, and its duplicates.
pub(crate) fn left_out(file: &Path) -> anyhow::Result<Vec<u32>> {
    #[derive(Deserialize)]
    struct Subsets {
        dev100: Vec<u32>,
        #[serde(default)]
        duplicate_pairs: Vec<[u32; 2]>,
    }
    let subsets = file.with_file_name("subsets.json");
    let text = match std::fs::read_to_string(&subsets) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        text => text.with_context(|| subsets.display().to_string())?,
    };
    let Subsets { dev100, duplicate_pairs } =
        serde_json::from_str(&text).with_context(|| subsets.display().to_string())?;
    let twins = duplicate_pairs.iter().filter(|pair| pair.iter().any(|id| dev100.contains(id)));
    Ok(dev100.iter().copied().chain(twins.flatten().copied()).collect())
}
