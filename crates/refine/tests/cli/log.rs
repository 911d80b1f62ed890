//! `prehend track` of robots' logs.

use crate::fixture::Workplace;

#[cfg(not(feature = "mcap"))]
#[test]
fn a_build_without_logs_says_how_to_get_them() {
    let place = Workplace::new();
    let films =
        ["--mcap log.mcap --mesh m.ply --search", "--dataset ds --search --mcap-out o.mcap"];
    for film in films {
        let said = place.prehend(&format!("track {film} --out t.csv"));
        assert!(said.code == 1 && said.err.contains("--features mcap"), "{}", said.err);
    }
}

#[cfg(feature = "mcap")]
mod with_logs {
    use serde_json::Value;

    use super::*;

    const LOG: &str = "track --mcap log.mcap --mesh ds/models/obj_000005.ply --mesh-unit mm \
                       --hand ds/hand/hand.urdf --taxels ds/hand/taxels.csv --poses ds/init.csv";

    /// Tracks the sample and records it; returns the object's mass \[kg\].
    fn record(place: &Workplace) -> f64 {
        // A log has no center of mass.
        let info = "ds/models/models_info.json";
        let mut models: Value = serde_json::from_str(&place.read(info)).unwrap();
        let object = models["5"].as_object_mut().unwrap();
        object.remove("com_mm");
        object.remove("inertia_kg_m2");
        let mass = object["mass_kg"].as_f64().unwrap();
        place.write(info, &models.to_string());
        let film = "track --dataset ds --poses ds/init.csv --out t.csv --mcap-out log.mcap";
        place.succeed(film);
        mass
    }

    #[test]
    fn a_film_goes_through_a_mcap_log_and_comes_back_with_the_same_poses() {
        let place = Workplace::new();
        let mass = record(&place);
        place.succeed(&format!("{LOG} --mass {mass} --out back.csv --mcap-out again.mcap"));
        assert_eq!(place.read("back.csv"), place.read("t.csv"));
        std::fs::rename(place.path("again.mcap"), place.path("log.mcap")).unwrap();
        place.succeed(&format!("{LOG} --mass {mass} --out again.csv"));
        assert_eq!(place.read("again.csv"), place.read("t.csv"));
    }

    #[test]
    fn faults_of_a_mcap_log_are_named() {
        let place = Workplace::new();
        record(&place);
        let log = std::fs::read(place.path("log.mcap")).unwrap();
        let said = place.prehend(&format!("{LOG} --topic color=/nowhere --out t.csv"));
        assert!(said.code == 1 && said.err.contains("/nowhere"), "{}", said.err);
        let said = place.prehend(&format!("{LOG} --topic sound=/a --out t.csv"));
        assert!(said.code == 1 && said.err.contains("sound"), "{}", said.err);
        std::fs::write(place.path("log.mcap"), &log[..log.len() - 100]).unwrap();
        let said = place.prehend(&format!("{LOG} --out cut.csv"));
        assert!(
            said.code == 2 && said.err.contains("log.mcap: the file is cut off"),
            "{}",
            said.err
        );
        assert_eq!(place.poses("cut.csv").len(), 2);
        for taken in ["log.mcap", "ds/init.csv", "t.csv"] {
            let said = place.prehend(&format!("{LOG} --out t.csv --mcap-out {taken}"));
            assert!(said.code == 1 && said.err.contains("--mcap-out"), "{}", said.err);
        }
        std::fs::write(place.path("log.mcap"), &log[..100]).unwrap();
        let said = place.prehend(&format!("{LOG} --out none.csv --mcap-out none.mcap"));
        assert!(said.code == 1 && said.err.contains("log.mcap"), "{}", said.err);
        assert!(!place.path("none.csv").exists() && !place.path("none.mcap").exists());
    }
}
