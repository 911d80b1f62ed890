//! A small dataset on disk, read back, and then broken in every way that has an error of its own.

mod sensors;

use std::fs;
use std::path::{Path, PathBuf};

use image::{ImageBuffer, Luma, Rgb};
use nalgebra::{Isometry3, Vector3};
use prehend_refine::data::bop::{
    Dataset, DatasetError, GroundTruth, SceneBodies, Tactile, TactileReading,
};

const R: &str = "[0, -1, 0, 1, 0, 0, 0, 0, 1]";

/// Scene 4 with the images 0 (object 7) and 3 (objects 7 and 7).
struct Fixture {
    dir: tempfile::TempDir,
}

impl Fixture {
    fn new() -> Self {
        let fixture = Self { dir: tempfile::tempdir().unwrap() };
        let camera = |fx: f64| {
            format!(r#"{{"cam_K": [{fx}, 0, 1.5, 0, 510, 1, 0, 0, 1], "depth_scale": 0.5}}"#)
        };
        fixture.scene(
            "scene_camera.json",
            &format!(r#"{{"0": {}, "3": {}}}"#, camera(500.0), camera(600.0)),
        );
        let body = |t: &str| {
            format!(
                r#"{{"gravity": [0, 9.81, 0], "bodies": [{{"name": "hand", "urdf": "hand/hand.urdf",
                   "cam_R_b2c": {R}, "cam_t_b2c": {t}, "joints": {{"b": 0.5, "a": -1}}}}]}}"#
            )
        };
        fixture.scene(
            "scene_bodies.json",
            &format!(r#"{{"0": {}, "3": {}}}"#, body("[1, 2, 500]"), body("[0, 0, 400]")),
        );
        fixture.scene(
            "scene_tactile.json",
            r#"{"0": {"body": "hand", "taxels": "hand/taxels.csv", "force": [[0, 0, 0], [100, -250, 10000]]}}"#,
        );
        let object = |t: &str| format!(r#"{{"cam_R_m2c": {R}, "cam_t_m2c": {t}, "obj_id": 7}}"#);
        let (a, b) = (object("[0, 0, 500]"), object("[100, 0, 500]"));
        fixture.scene("scene_gt.json", &format!(r#"{{"0": [{a}], "3": [{a}, {b}]}}"#));
        fixture.image("rgb/000000.png", |p| {
            ImageBuffer::from_pixel(4, 3, Rgb([255u8, 0, 51])).save(p).unwrap()
        });
        fixture.image("rgb/000003.jpg", |p| {
            ImageBuffer::from_pixel(4, 3, Rgb([128u8, 128, 128])).save(p).unwrap()
        });
        for im in [0, 3] {
            fixture.image(&format!("depth/{im:06}.png"), |p| {
                ImageBuffer::from_pixel(4, 3, Luma([1000u16])).save(p).unwrap();
            });
        }
        for (name, pixels) in [("000000_000005", 1), ("000003_000000", 2), ("000003_000001", 3)] {
            fixture.mask(name, pixels);
        }
        fixture.write("models/models_info.json", r#"{"7": {"diameter": 100}}"#);
        fixture.write("models/obj_000007.ply", "ply");
        fixture
    }

    fn root(&self) -> &Path {
        self.dir.path()
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.root().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, text).unwrap();
        path
    }

    fn scene(&self, name: &str, text: &str) -> PathBuf {
        self.write(&format!("test/000004/{name}"), text)
    }

    fn image(&self, name: &str, save: impl Fn(&Path)) -> PathBuf {
        let path = self.scene(name, "");
        save(&path);
        path
    }

    /// A mask whose first `pixels` pixels are set.
    fn mask(&self, name: &str, pixels: usize) -> PathBuf {
        self.image(&format!("mask_visib/{name}.png"), |p| {
            let data: Vec<u8> = (0..12).map(|i| if i < pixels { 255u8 } else { 0 }).collect();
            ImageBuffer::<Luma<u8>, _>::from_raw(4, 3, data).unwrap().save(p).unwrap();
        })
    }

    fn remove(&self, name: &str) -> PathBuf {
        let path = self.root().join("test/000004").join(name);
        fs::remove_file(&path).unwrap();
        path
    }

    fn open(&self) -> Dataset {
        Dataset::open(self.root()).unwrap()
    }
}

/// Problem of a file that is absent.
const ABSENT: &str = "no such file or folder";

fn missing(file: &Path, problem: &str) -> DatasetError {
    DatasetError::Missing { file: file.to_owned(), problem: problem.to_owned() }
}

#[test]
fn reads_everything_in_meters_and_newtons() {
    let fixture = Fixture::new();
    let dataset = fixture.open();
    assert_eq!(dataset.scenes().map(|s| s.images().unwrap()).collect::<Vec<_>>(), [[0, 3]]);
    let frame = dataset.frame(4, 0).unwrap();
    let k = frame.camera(4, 3);
    assert_eq!((k.fx, k.fy, k.cx, k.cy, frame.depth_scale), (500.0, 510.0, 1.5, 1.0, 0.5));
    let seen = frame.observation(0).unwrap();
    assert_eq!(
        (seen.color.width(), seen.color.height(), seen.color.pixels()[0]),
        (4, 3, [1.0, 0.0, 0.2])
    );
    assert_eq!(seen.depth.pixels(), [0.5; 12]);
    assert_eq!(seen.mask.count(), 1);
    let bodies: SceneBodies = frame.bodies().unwrap();
    assert_eq!(bodies.gravity, Some(Vector3::new(0.0, 9.81, 0.0)));
    let [hand] = &bodies.bodies[..] else { panic!("not one body") };
    let (urdf, joints) = hand.as_hand().unwrap();
    assert_eq!(urdf, fixture.root().join("hand/hand.urdf"));
    assert!((hand.t_cam_base.translation.vector - Vector3::new(0.001, 0.002, 0.5)).norm() < 1e-18);
    assert_eq!(
        joints.iter().map(|(n, &q)| (n.as_str(), q)).collect::<Vec<_>>(),
        [("a", -1.0), ("b", 0.5)]
    );
    let [Tactile { taxels, reading: TactileReading::Force(force), .. }] =
        &frame.tactile().unwrap()[..]
    else {
        panic!("not one sensor of force")
    };
    assert_eq!(force[1] * Tactile::UNITS_PER_NEWTON, Vector3::new(100.0, -250.0, 10000.0));
    assert_eq!(*taxels, Some(fixture.root().join("hand/taxels.csv")));
    assert!(dataset.frame(4, 3).unwrap().rgb_path().unwrap().ends_with("rgb/000003.jpg"));
}

fn no_mask(file: &Path, problem: &str) -> DatasetError {
    DatasetError::NoMask { file: file.to_owned(), problem: problem.to_owned() }
}

#[test]
fn the_only_mask_serves_any_row_and_several_go_by_row() {
    let fixture = Fixture::new();
    let dataset = fixture.open();
    let count =
        |im: u32, instance: usize| dataset.frame(4, im).unwrap().mask(instance).map(|m| m.count());
    // Files of other kinds do not count.
    fixture.scene("mask_visib/000000_000005.txt", "notes");
    assert_eq!((count(0, 0), count(0, 2)), (Ok(1), Ok(1)));
    assert_eq!((count(3, 0), count(3, 1)), (Ok(2), Ok(3)));
    let absent = fixture.root().join("test/000004/mask_visib/000003_000002.png");
    assert_eq!(count(3, 2), Err(no_mask(&absent, ABSENT)));
}

#[test]
fn images_are_found_by_their_numbers() {
    let fixture = Fixture::new();
    let rename = |from: &str, to: &str| {
        let scene = fixture.root().join("test/000004");
        fs::rename(scene.join(from), scene.join(to)).unwrap();
    };
    rename("rgb/000000.png", "rgb/0.PNG");
    rename("rgb/000003.jpg", "rgb/3.JPG");
    rename("depth/000000.png", "depth/00.png");
    rename("mask_visib/000000_000005.png", "mask_visib/0_5.png");
    let camera = fixture.root().join("test/000004/scene_camera.json");
    let padded = fs::read_to_string(&camera).unwrap().replace("\"0\":", "\"000000\":");
    fs::write(&camera, padded).unwrap();
    let dataset = fixture.open();
    assert_eq!(dataset.scene(4).unwrap().images().unwrap(), [0, 3]);
    let frame = dataset.frame(4, 0).unwrap();
    let seen = frame.observation(0).unwrap();
    let first = (seen.color.pixels()[0], seen.depth.pixels()[0], seen.mask.count());
    assert_eq!(first, ([1.0, 0.0, 0.2], 0.5, 1));
    assert!(dataset.frame(4, 3).unwrap().rgb_path().unwrap().ends_with("rgb/3.JPG"));
    rename("rgb/0.PNG", "rgb/0.tif");
    fixture.scene("rgb/5.tif", "");
    let error = frame.observation(0).unwrap_err().to_string();
    let expected = "rgb/000000.png: no such file; the folder has 0.tif, 3.JPG, 5.tif";
    assert!(error.ends_with(expected), "{error}");
    fixture.scene("rgb/6.tif", "");
    let error = frame.rgb_path().unwrap_err().to_string();
    assert!(error.ends_with("0.tif, 3.JPG, 5.tif, …"), "{error}");
}

#[test]
fn truth_prefers_its_own_files_and_falls_back() {
    let fixture = Fixture::new();
    let dataset = fixture.open();
    let truth = GroundTruth::new(&dataset);
    assert_eq!(truth.models().dir(), fixture.root().join("models"));
    assert_eq!(truth.bodies(4, 0).unwrap(), dataset.frame(4, 0).unwrap().bodies().unwrap());
    assert_eq!(truth.objects(4, 3).unwrap().len(), 2);
    // Of two equal objects the one near the estimate is meant.
    let near_second = Isometry3::translation(0.08, 0.0, 0.5);
    assert!((truth.pose(4, 3, 7, &near_second).unwrap().translation.vector.x - 0.1).abs() < 1e-15);

    let told = fs::read_to_string(fixture.root().join("test/000004/scene_bodies.json")).unwrap();
    fixture.scene("scene_bodies_gt.json", &told.replace("[1, 2, 500]", "[1, 2, 501]"));
    fixture.write("models_eval/models_info.json", "{}");
    let dataset = fixture.open();
    let truth = GroundTruth::new(&dataset);
    assert_eq!(truth.bodies(4, 0).unwrap().bodies[0].t_cam_base.translation.vector.z, 0.501);
    assert_eq!(truth.models().dir(), fixture.root().join("models_eval"));
}

#[test]
fn estimator_input_survives_without_the_truth() {
    let fixture = Fixture::new();
    fixture.remove("scene_gt.json");
    let dataset = fixture.open();
    let frame = dataset.frame(4, 3).unwrap();
    assert!(frame.observation(1).is_ok() && frame.bodies().is_ok());
    let error = GroundTruth::new(&dataset).objects(4, 3).unwrap_err();
    assert!(matches!(error, DatasetError::Missing { file, .. } if file.ends_with("scene_gt.json")));
}

#[test]
fn splits_scenes_and_images_that_are_not_there() {
    let fixture = Fixture::new();
    let absent = fixture.root().join("none");
    assert_eq!(Dataset::open(&absent).unwrap_err(), missing(&absent, ABSENT));
    let error = Dataset::open_split(fixture.root(), "none").unwrap_err();
    assert_eq!(error, missing(&absent, ABSENT));
    let error = Dataset::open_split(fixture.root(), "models").unwrap_err().to_string();
    assert!(error.contains("/models: no scene folders"), "{error}");
    let dataset = fixture.open();
    let error = dataset.frame(5, 0).unwrap_err().to_string();
    assert!(error.ends_with("/test: no scene 5"), "{error}");
    let error = dataset.frame(4, 1).unwrap_err();
    let camera = fixture.root().join("test/000004/scene_camera.json");
    assert_eq!(error, missing(&camera, "no entry \"1\""));
    let truth = GroundTruth::new(&dataset);
    let error = truth.objects(9, 0).unwrap_err().to_string();
    assert!(error.ends_with("/test: no scene 9"), "{error}");
    let error = truth.pose(4, 0, 8, &Isometry3::identity()).unwrap_err().to_string();
    assert!(error.ends_with("scene_gt.json: unknown object id 8"), "{error}");
    let error = dataset.models().info(8).unwrap_err().to_string();
    assert!(error.ends_with("models_info.json: no entry \"8\""), "{error}");
    let error = dataset.models().mesh_path(8).unwrap_err().to_string();
    assert!(error.ends_with("obj_000008.ply: unknown object id 8"), "{error}");
}

#[test]
fn the_split_is_the_only_one_or_test() {
    let fixture = Fixture::new();
    fs::create_dir_all(fixture.root().join("train/000001")).unwrap();
    assert!(fixture.open().split_dir().ends_with("test"));
    fs::rename(fixture.root().join("test"), fixture.root().join("val")).unwrap();
    let error = Dataset::open(fixture.root()).unwrap_err();
    assert!(error.to_string().ends_with("several splits, name one of train, val"), "{error}");
    fs::remove_dir_all(fixture.root().join("train")).unwrap();
    assert!(fixture.open().split_dir().ends_with("val"));
    fs::remove_dir_all(fixture.root().join("val")).unwrap();
    let error = Dataset::open(fixture.root()).unwrap_err().to_string();
    assert!(error.contains(": no scene folders"), "{error}");
}

#[test]
fn an_absent_or_broken_file_spoils_only_what_needs_it() {
    let fixture = Fixture::new();
    let bodies = fixture.remove("scene_bodies.json");
    let tactile = fixture.scene("scene_tactile.json", r#"{"0": {"body": "hand""#);
    let rgb = fixture.remove("rgb/000000.png");
    let dataset = fixture.open();
    let frame = dataset.frame(4, 0).unwrap();
    assert_eq!(frame.bodies(), Err(missing(&bodies, ABSENT)));
    assert!(matches!(frame.tactile(), Err(DatasetError::Unusable { file, .. }) if file == tactile));
    let problem = "no such file; the folder has 000003.jpg".to_owned();
    assert_eq!(frame.rgb_path(), Err(DatasetError::Unusable { file: rgb, problem }));
    assert!(frame.depth().is_ok() && frame.mask(0).is_ok());
    assert!(dataset.frame(4, 3).unwrap().rgb_path().is_ok());
}

#[test]
fn one_image_with_a_bad_field_leaves_the_others() {
    let fixture = Fixture::new();
    let good = r#"{"cam_K": [500, 0, 1, 0, 500, 1, 0, 0, 1], "depth_scale": 1}"#;
    let cameras = [
        (r#"{"depth_scale": 1}"#, "1: missing field `cam_K`"),
        (r#"{"cam_K": [500, 0, 1, 0, 500, 1, 0, 0]}"#, "2.cam_K: expected 9 numbers, found 8"),
        (r#"{"cam_K": [NaN, 0, 1, 0, 500, 1, 0, 0, 1]}"#, "3.cam_K[0]: number out of range"),
        (
            r#"{"cam_K": [-500, 0, 1, 0, 500, 1, 0, 0, 1]}"#,
            "4.cam_K: focal length fx is -500 px, expected more than zero and 1e9 at most",
        ),
        (
            r#"{"cam_K": [500, 3, 1, 0, 500, 1, 0, 0, 1]}"#,
            "5.cam_K: camera matrix entry 1 is 3, expected 0 (row-major, no skew)",
        ),
        (
            r#"{"cam_K": [500, 0, 1, 0, 500, 1, 0, 0, 1], "depth_scale": 0}"#,
            "6.depth_scale: must be above zero",
        ),
    ];
    let mut text = format!(r#"{{"0": {good}"#);
    for (i, (entry, _)) in cameras.iter().enumerate() {
        text += &format!(r#", "{}": {entry}"#, i + 1);
    }
    fixture.scene("scene_camera.json", &format!("{text}}}"));
    let dataset = fixture.open();
    assert!(dataset.frame(4, 0).is_ok());
    for (i, (_, expected)) in cameras.iter().enumerate() {
        let error = dataset.frame(4, i as u32 + 1).unwrap_err().to_string();
        assert!(error.contains("scene_camera.json") && error.contains(expected), "{error}");
    }
}

#[test]
fn robot_touch_and_truth_fields_are_named() {
    let fixture = Fixture::new();
    fixture.scene(
        "scene_bodies.json",
        r#"{"0": {"gravity": [0, 0, 9], "bodies": [{"name": "hand", "urdf": "h", "cam_R_b2c": [1, 0, 0, 0, 1, 0, 0, 0, 2],
           "cam_t_b2c": [0, 0, 1], "joints": {}}]},
           "3": {"gravity": [0, 0, 9], "bodies": [{"name": "hand", "urdf": "h", "cam_R_b2c": [1, 0, 0, 0, 1, 0, 0, 0, 1],
           "cam_t_b2c": [0, 0, 1], "joints": {"j": "far"}}]}}"#,
    );
    fixture.scene(
        "scene_tactile.json",
        r#"{"0": {"body": "hand", "taxels": "t", "force": [[0, 0, 0], [1, 2]]}}"#,
    );
    fixture.scene(
        "scene_gt.json",
        r#"{"0": [{"cam_R_m2c": [1, 0, 0, 0, 1, 0, 0, 0, 1], "cam_t_m2c": [0, 0, 1]}]}"#,
    );
    let dataset = fixture.open();
    let frame = dataset.frame(4, 0).unwrap();
    let message = |e: DatasetError| e.to_string();
    assert!(
        message(frame.bodies().unwrap_err())
            .contains("scene_bodies.json: 0.bodies[0].cam_R_b2c: not orthonormal")
    );
    let other = dataset.frame(4, 3).unwrap().bodies().unwrap_err();
    assert!(message(other).contains("3.bodies[0].joints.j: invalid type: string"));
    assert!(
        message(frame.tactile().unwrap_err())
            .contains("scene_tactile.json: 0.force[1]: expected 3 numbers, found 2")
    );
    let truth = GroundTruth::new(&dataset);
    assert!(
        message(truth.objects(4, 0).unwrap_err())
            .contains("scene_gt.json: 0[0]: missing field `obj_id`")
    );
}

#[test]
fn images_that_cannot_serve() {
    let fixture = Fixture::new();
    let depth = fixture.image("depth/000000.png", |p| {
        ImageBuffer::from_pixel(4, 3, Luma([0u16])).save(p).unwrap()
    });
    let mask = fixture.mask("000000_000005", 0);
    let odd = fixture.image("depth/000003.png", |p| {
        ImageBuffer::from_pixel(3, 4, Luma([1000u16])).save(p).unwrap()
    });
    let dataset = fixture.open();
    let frame = dataset.frame(4, 0).unwrap();
    assert_eq!(frame.depth(), Err(missing(&depth, "every depth is zero")));
    assert_eq!(frame.mask(0), Err(no_mask(&mask, "the mask is empty")));
    // Without depth there is color.
    assert_eq!(frame.observation(0).unwrap_err(), no_mask(&mask, "the mask is empty"));
    let error = dataset.frame(4, 3).unwrap().observation(0).unwrap_err().to_string();
    assert!(error.starts_with(&format!("{}: is 3x4 pixels but ", odd.display())), "{error}");
    assert!(error.contains("000003.jpg is 4x3: one of them is turned by 90°"), "{error}");
    let bytes = fs::read(&odd).unwrap();
    fs::write(&odd, &bytes[..bytes.len() - 20]).unwrap();
    let error = dataset.frame(4, 3).unwrap().depth().unwrap_err().to_string();
    assert!(error.starts_with(&odd.display().to_string()), "{error}");
}

#[test]
fn a_folder_in_a_files_place_cannot_be_read() {
    let fixture = Fixture::new();
    let path = fixture.remove("scene_camera.json");
    fs::create_dir(&path).unwrap();
    assert!(
        matches!(fixture.open().frame(4, 0), Err(DatasetError::Unusable { file, problem }) if file == path && problem.starts_with("cannot be read: "))
    );
}
