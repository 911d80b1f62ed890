//! Forces whose balance tells gains, and such whose balance does not.

use prehend_geometry::SplitMix64;

use super::super::reading::tests::reading;
use super::*;
use crate::scene::{Object, default_scene};

/// Gains as they are, gains and deviations as they are found, and masses.
struct Solved {
    truth: Vec<f64>,
    gains: Vec<(f64, f64)>,
    masses: BTreeMap<u32, ObjectMass>,
    /// The true one [kg].
    mass: f64,
}

/// Forces at a dozen taxels that hold the object, read with gains of which the first `seen` are known to the skin.
/// The mass is given `heavier` times as large as it is, and is assumed by density if that is not 1.
fn solved(seen: usize, heavier: f64) -> Solved {
    let scene = default_scene(1).unwrap();
    let mut reading = reading(&scene, Vector3::zeros());
    let mut noise = SplitMix64::new(4);
    let taxels: Vec<usize> = (0..12).map(|k| 30 * k).collect();
    let truth: Vec<f64> = taxels.iter().map(|_| 0.75 + 0.5 * noise.uniform()).collect();
    let mut sums = BalanceSums::default();
    let inertial = reading.object.inertial.clone();
    let mut given =
        Object::new("given", scene.object.mesh.clone(), Some(inertial.clone()), 0).unwrap();
    given.inertial.mass *= heavier;
    given.inertial_assumed = heavier != 1.0;
    reading.object = given.into();
    for _ in 0..60 {
        let random = |noise: &mut SplitMix64| Vector3::from_fn(|_, _| noise.normal());
        let gravity = random(&mut noise).normalize() * 9.81;
        reading.gravity = Some(gravity);
        let load = gravity * inertial.mass;
        let mut all = DVector::zeros(36);
        all.iter_mut().for_each(|f| *f = noise.normal());
        let mut wrenches = DMatrix::zeros(6, 36);
        for (k, taxel) in taxels.iter().enumerate() {
            let arm = (reading.place(*taxel) - inertial.center_of_mass) / reading.object.radius;
            for axis in 0..3 {
                let torque = arm.cross(&Vector3::ith(axis, 1.0));
                wrenches[(axis, 3 * k + axis)] = 1.0;
                wrenches.fixed_view_mut::<3, 1>(3, 3 * k + axis).copy_from(&torque);
            }
        }
        let mut load_of_all = DVector::zeros(6);
        load_of_all.rows_mut(0, 3).copy_from(&load);
        let wrong = &wrenches * &all - load_of_all;
        all -= wrenches.clone().pseudo_inverse(1e-9).unwrap() * wrong;
        let mut forces = vec![Vector3::zeros(); 368];
        for (k, taxel) in taxels.iter().enumerate().take(seen) {
            let force = Vector3::new(all[3 * k], all[3 * k + 1], all[3 * k + 2]);
            let turn = reading.t_object_links[*taxel].rotation.inverse();
            forces[*taxel] = turn * force * truth[k];
        }
        sums.add(&reading, &forces, 1.0);
    }
    let (gains, masses) = sums.solve(368);
    let gains = taxels.iter().map(|taxel| gains[*taxel]).collect();
    Solved { truth, gains, masses, mass: inertial.mass }
}

#[test]
fn where_all_contacts_are_felt_their_balance_tells_gains() {
    let Solved { truth, gains: found, .. } = solved(12, 1.0);
    let rms = |errors: Vec<f64>| (errors.iter().map(|e| e * e).sum::<f64>() / 12.0).sqrt();
    let before = rms(truth.iter().map(|gain| gain - 1.0).collect());
    let after = rms(truth.iter().zip(&found).map(|(gain, (f, _))| f - gain).collect());
    assert!(after < 0.5 * before, "{after} {before}");
    for (gain, (found, sigma)) in truth.iter().zip(&found) {
        assert!((found - gain).abs() < 3.0 * sigma, "{gain} {found} {sigma}");
        assert!(*sigma < 0.8 * GAIN_SIGMA, "{sigma}");
    }
}

#[test]
fn where_all_contacts_are_felt_their_balance_tells_masses() {
    let Solved { masses, mass, .. } = solved(12, 1.3);
    let [(_, found)] = Vec::from_iter(masses)[..] else { panic!("not one mass") };
    assert!((found.mass - mass).abs() < 3.0 * found.sigma, "{found:?}, not {mass}");
    assert!(found.sigma < 0.2 * mass && found.mass < 1.15 * mass, "{found:?}, not {mass}");
}

#[test]
fn where_contacts_are_unseen_nothing_is_claimed() {
    let Solved { gains: found, masses, .. } = solved(6, 1.0);
    for (gain, sigma) in &found {
        assert!((gain - 1.0).abs() < 0.1 && *sigma > 0.8 * GAIN_SIGMA, "{gain} {sigma}");
    }
    assert!(masses.is_empty(), "{masses:?}");
}
