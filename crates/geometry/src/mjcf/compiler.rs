//! The `compiler` element: how the rest of a model is to be understood.

use super::element::Element;
use super::error::Result;
use super::value::{Limited, Limits};

/// Whose inertia a body has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum InertiaFrom {
    /// That of its `inertial` element or else of its geoms.
    Either,
    /// That of its geoms, even where it has an `inertial` element.
    Geoms,
    /// That of its `inertial` element, or none.
    Element,
}

/// Settings of all `compiler` elements together; what comes later counts.
#[derive(Clone, Debug)]
pub(super) struct Compiler {
    pub(super) degrees: bool,
    pub(super) auto_limits: bool,
    /// Axes of Euler angles: 0 to 2, and whether they stay while the body turns.
    pub(super) euler: [(usize, bool); 3],
    pub(super) mesh_folder: String,
    pub(super) strip_path: bool,
    pub(super) inertia_from: InertiaFrom,
    /// First and last group of geoms whose mass counts.
    pub(super) inertia_groups: [f64; 2],
    /// Least mass \[kg\] and least principal inertia \[kg m²\] of a body.
    pub(super) least: [f64; 2],
    /// Whether inertias that no body can have are made those of a ball.
    pub(super) balance: bool,
    /// Mass that all bodies are scaled to \[kg\].
    pub(super) total_mass: Option<f64>,
    /// Whether meshes are stood in for by the box around them, not by that of their inertia.
    pub(super) fit_bounds: bool,
}

/// The compilers of a model and of all that are attached to it, by the scope of their elements.
pub(super) struct Compilers(pub(super) Vec<Compiler>);

impl Compilers {
    /// The compiler that `e` is read with.
    pub(super) fn of(&self, e: &Element) -> &Compiler {
        &self.0[e.scope]
    }
}

impl Compiler {
    /// Settings of the `compiler` elements in `root`.
    pub(super) fn read(root: &Element) -> Result<Self> {
        let mut all = Self {
            degrees: true,
            auto_limits: true,
            euler: [(0, false), (1, false), (2, false)],
            mesh_folder: String::new(),
            strip_path: false,
            inertia_from: InertiaFrom::Either,
            inertia_groups: [0.0, 5.0],
            least: [0.0; 2],
            balance: false,
            total_mass: None,
            fit_bounds: false,
        };
        root.sections("compiler").try_for_each(|e| all.add(e))?;
        Ok(all)
    }

    fn add(&mut self, e: &Element) -> Result<()> {
        if let Some(degrees) = e.keyword("angle", &[("degree", true), ("radian", false)])? {
            self.degrees = degrees;
        }
        e.keyword("coordinate", &[("local", ())])?;
        if let Some(axes) = e.text("eulerseq") {
            self.euler = euler(axes).ok_or_else(|| {
                e.invalid("eulerseq", format!("is '{axes}', not three of xyz and XYZ"))
            })?;
        }
        let inertia = [
            ("auto", InertiaFrom::Either),
            ("true", InertiaFrom::Geoms),
            ("false", InertiaFrom::Element),
        ];
        self.inertia_from = e.keyword("inertiafromgeom", &inertia)?.unwrap_or(self.inertia_from);
        self.inertia_groups = e.numbers("inertiagrouprange")?.unwrap_or(self.inertia_groups);
        for folder in ["assetdir", "meshdir"] {
            if let Some(name) = e.text(folder) {
                self.mesh_folder = name.to_owned();
            }
        }
        let switches = [
            ("autolimits", &mut self.auto_limits),
            ("strippath", &mut self.strip_path),
            ("balanceinertia", &mut self.balance),
            ("fitaabb", &mut self.fit_bounds),
        ];
        for (name, value) in switches {
            *value = e.switch(name)?.unwrap_or(*value);
        }
        self.least[0] = e.magnitude("boundmass")?.unwrap_or(self.least[0]);
        self.least[1] = e.magnitude("boundinertia")?.unwrap_or(self.least[1]);
        if let Some(mass) = e.number("settotalmass")? {
            self.total_mass = (mass > 0.0).then_some(mass);
        }
        Ok(())
    }

    /// An angle of the file in radians.
    pub(super) fn angle(&self, value: f64) -> f64 {
        if self.degrees { value.to_radians() } else { value }
    }

    /// The range that counts, from the attributes `limited_field` and `field` of `e` or its classes.
    pub(super) fn range(
        &self,
        e: &Element,
        [limited_field, field]: [&'static str; 2],
        Limits { range: [low, high], limited }: Limits,
    ) -> Result<Option<(f64, f64)>> {
        let given = low != 0.0 || high != 0.0;
        let is_limited = match limited {
            Limited::Yes => true,
            Limited::No => false,
            Limited::Auto if !self.auto_limits && given => {
                let reason = "must be told with a range, since autolimits is false";
                return Err(e.invalid(limited_field, reason));
            }
            Limited::Auto => given,
        };
        match is_limited {
            false => Ok(None),
            true if low < high => Ok(Some((low, high))),
            true => Err(e.invalid(field, format!("is from {low} to {high}, which is no range"))),
        }
    }
}

fn euler(text: &str) -> Option<[(usize, bool); 3]> {
    let axis = |letter: char| {
        let axis = "xyz".find(letter.to_ascii_lowercase())?;
        Some((axis, letter.is_ascii_uppercase()))
    };
    let axes: Option<Vec<_>> = text.trim().chars().map(axis).collect();
    axes?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::super::Model;
    use super::Result;

    fn range(compiler: &str, joint: &str) -> Result<Option<(f64, f64)>> {
        let xml = format!(
            "<mujoco><compiler angle=\"radian\" {compiler}/><worldbody><body><joint name=\"q\" {joint}/>\
            <geom size=\"1\"/></body></worldbody></mujoco>"
        );
        Ok(Model::from_str(&xml, None)?.bodies[0].joints[0].range)
    }

    #[test]
    fn a_range_limits_unless_told_otherwise() {
        let told = Some((-1.0, 2.0));
        for (joint, expected) in [
            ("", None),
            ("range=\"0 0\"", None),
            ("range=\"-1 2\"", told),
            ("range=\"-1 2\" limited=\"auto\"", told),
            ("range=\"-1 2\" limited=\"true\"", told),
            ("range=\"-1 2\" limited=\"false\"", None),
        ] {
            assert_eq!(range("", joint).unwrap(), expected, "{joint}");
        }
        let off = "autolimits=\"false\"";
        assert_eq!(range(off, "").unwrap(), None);
        assert_eq!(range(off, "range=\"-1 2\" limited=\"true\"").unwrap(), told);
        let error = range(off, "range=\"-1 2\"").unwrap_err().to_string();
        assert!(error.contains("joint 'q': limited must be told"), "{error}");
        for joint in ["range=\"2 -1\"", "limited=\"true\""] {
            let error = range("", joint).unwrap_err().to_string();
            assert!(error.contains("which is no range"), "{error}");
        }
    }

    #[test]
    fn sections_add_up_and_degrees_are_the_default() {
        let read = |compilers: &str| {
            let xml = format!(
                "<mujoco>{compilers}<worldbody><body><joint range=\"0 90\"/><joint type=\"slide\" range=\"0 90\"/>\
                <geom size=\"1\"/></body></worldbody></mujoco>"
            );
            let body = Model::from_str(&xml, None).unwrap().bodies.remove(0);
            [0, 1].map(|k| body.joints[k].range.unwrap().1)
        };
        assert_eq!(read(""), [std::f64::consts::FRAC_PI_2, 90.0]);
        assert_eq!(read("<compiler angle=\"degree\"/><compiler angle=\"radian\"/>"), [90.0; 2]);
        assert_eq!(read("<compiler angle=\"radian\"/><compiler autolimits=\"true\"/>"), [90.0; 2]);
    }

    #[test]
    fn masses_can_be_bounded_balanced_and_scaled() {
        // As MuJoCo has them, too.
        for (compiler, diagonal, mass, expected) in [
            ("boundmass=\"0.5\" boundinertia=\"0.2\"", "0.1 0.3 0.3", 0.5, [0.2, 0.3, 0.3]),
            ("balanceinertia=\"true\"", "0.1 0.1 0.3", 0.1, [0.5 / 3.0; 3]),
            ("settotalmass=\"2\"", "0.2 0.2 0.3", 2.0, [4.0, 4.0, 6.0]),
        ] {
            let xml = format!(
                "<mujoco><compiler {compiler}/><worldbody><body><joint/>\
                <inertial mass=\"0.1\" pos=\"0 0 0\" diaginertia=\"{diagonal}\"/></body></worldbody></mujoco>"
            );
            let inertial = Model::from_str(&xml, None).unwrap().bodies[0].inertial.unwrap();
            assert!((inertial.mass - mass).abs() < 1e-12, "{compiler}");
            let off = inertial.inertia.diagonal() - nalgebra::Vector3::from(expected);
            assert!(off.norm() < 1e-12, "{compiler}: {}", inertial.inertia);
        }
    }
}
