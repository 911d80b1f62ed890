#![doc = include_str!("guide_links.md")]
#![doc = include_str!("../docs/guide/README.md")]

/// A chapter. Links of the guide are references, which resolve to files in a checkout. `guide_links.md` comes first and defines them anew for
/// rustdoc, since of two definitions the first counts. Tests do without it, so that they have the lines of the chapter.
macro_rules! chapter {
    ($name:ident, $file:literal) => {
        #[cfg_attr(not(doctest), doc = include_str!("guide_links.md"))]
        #[doc = include_str!(concat!("../docs/guide/", $file))]
        pub mod $name {}
    };
}

chapter!(quick_start, "quick-start.md");
chapter!(concepts, "concepts.md");
chapter!(frames_and_units, "frames-and-units.md");
chapter!(robot, "robot.md");
chapter!(rig, "rig.md");
chapter!(performance, "performance.md");
chapter!(contact_law, "contact-law.md");
chapter!(factor, "factor.md");
chapter!(coming_from, "coming-from.md");
