//! Which topics are read.

use std::collections::BTreeMap;

use super::images::Content;

/// Everything that this program writes besides what it has read is below it, and is not read again.
pub(super) const OURS: &str = "/prehend/";

/// Topics of images to be read; one without a name is the only one that can be meant.
#[derive(Clone, Debug, Default)]
pub struct ImageTopics {
    /// Color.
    pub color: Option<String>,
    /// Depth.
    pub depth: Option<String>,
    /// Mask of the object, where there is one; by default the gray topic whose name ends in `mask`.
    pub mask: Option<String>,
}

/// A topic of images: what its first message says.
#[derive(Clone, Debug)]
pub(super) struct ImageTopic {
    pub(super) name: String,
    /// Type of the messages.
    pub(super) kind: String,
    pub(super) frame_id: String,
    pub(super) content: Content,
}

/// The topics of images that are read.
#[derive(Clone, Debug)]
pub(super) struct Chosen {
    /// Each of its images is a frame: color, or depth without it.
    pub(super) frames: ImageTopic,
    pub(super) has_color: bool,
    /// Depth beside color.
    pub(super) depth: Option<ImageTopic>,
    pub(super) mask: Option<ImageTopic>,
}

/// Topics of images by name.
pub(super) type Known = BTreeMap<String, ImageTopic>;

impl Chosen {
    /// Topics that are `wanted`, among those that the recording has.
    ///
    /// # Errors
    /// If one is not found: its name, and the problem.
    pub(super) fn new(known: &Known, wanted: &ImageTopics) -> Result<Self, (String, String)> {
        let is_mask = |name: &str| name.ends_with("mask");
        let among = |content: Content, masks: bool| {
            let fits = move |topic: &&ImageTopic| {
                let name = &topic.name;
                topic.content == content && is_mask(name) == masks && !name.starts_with(OURS)
            };
            known.values().filter(fits).map(|topic| topic.name.as_str()).collect::<Vec<_>>()
        };
        let mut colors = among(Content::Color, false);
        if colors.is_empty() {
            colors = among(Content::Gray, false);
        }
        let pick = |what: &str, name: &Option<String>, candidates: &[&str]| {
            let name = match (name.as_deref(), candidates) {
                (Some(name), _) => name,
                (None, []) => return Ok(None),
                (None, [only]) => *only,
                (None, several) => {
                    let problem = format!("say which it is: {}", several.join(", "));
                    return Err((format!("the topic of {what}"), problem));
                }
            };
            let topic = known.get(name).cloned().ok_or_else(|| {
                let names: Vec<&str> = known.keys().map(String::as_str).collect();
                let problem = format!("there are no images of this name, but {}", names.join(", "));
                (name.to_owned(), problem)
            });
            topic.map(Some)
        };
        let color = pick("color", &wanted.color, &colors)?;
        let depth = pick("depth", &wanted.depth, &among(Content::Depth, false))?;
        let mask = pick("masks", &wanted.mask, &among(Content::Gray, true))?;
        let has_color = color.is_some();
        let (frames, depth) = match (color, depth) {
            (Some(color), depth) => {
                let beside = depth.filter(|depth| depth.name != color.name);
                (color, beside)
            }
            (None, Some(depth)) => (depth, None),
            (None, None) => return Err(("images".to_owned(), "there are none".to_owned())),
        };
        Ok(Self { frames, has_color, depth, mask })
    }
}

/// Topics that may have the camera of the images of `topic`, the likeliest first: `camera_info` beside them, or above what a transport has added.
pub(super) fn camera_topics(topic: &str) -> impl Iterator<Item = String> {
    let mut above = topic;
    std::iter::from_fn(move || {
        above = above.rsplit_once('/')?.0;
        Some(format!("{above}/camera_info"))
    })
}

/// Whether the images of `topic` were rectified (`image_rect`, `image_rect_color`).
pub(super) fn is_rectified(topic: &str) -> bool {
    topic.split('/').any(|part| part.starts_with("image_rect"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(topics: &[(&str, Content)]) -> Known {
        let entry = |(name, content): &(&str, Content)| {
            let (name, kind, frame_id) = ((*name).to_owned(), String::new(), String::new());
            (name.clone(), ImageTopic { name, kind, frame_id, content: *content })
        };
        topics.iter().map(entry).collect()
    }

    #[test]
    fn the_only_topics_are_taken_and_several_are_asked_about() {
        use Content::{Color, Depth, Gray};
        let some = known(&[
            ("/a/color", Color),
            ("/a/infra", Gray),
            ("/a/mask", Gray),
            ("/d", Depth),
            ("/prehend/overlay", Color),
        ]);
        let chosen = Chosen::new(&some, &ImageTopics::default()).unwrap();
        assert_eq!((chosen.frames.name.as_str(), chosen.has_color), ("/a/color", true));
        assert_eq!(chosen.mask.unwrap().name, "/a/mask");
        let two = known(&[("/d", Depth), ("/e", Depth)]);
        let (what, problem) = Chosen::new(&two, &ImageTopics::default()).unwrap_err();
        assert_eq!(
            (what.as_str(), problem.as_str()),
            ("the topic of depth", "say which it is: /d, /e")
        );
        let wanted = ImageTopics { depth: Some("/e".to_owned()), ..ImageTopics::default() };
        let chosen = Chosen::new(&two, &wanted).unwrap();
        assert_eq!((chosen.frames.name.as_str(), chosen.has_color), ("/e", false));
        let wanted = ImageTopics { color: Some("/f".to_owned()), ..ImageTopics::default() };
        assert_eq!(Chosen::new(&two, &wanted).unwrap_err().0, "/f");
        assert!(Chosen::new(&Known::new(), &ImageTopics::default()).is_err());
    }

    #[test]
    fn cameras_are_looked_for_beside_images_and_above() {
        let topics: Vec<_> = camera_topics("/c/image_raw/compressed").collect();
        assert_eq!(topics, ["/c/image_raw/camera_info", "/c/camera_info", "/camera_info"]);
        assert!(is_rectified("/c/image_rect_color/compressed") && !is_rectified("/c/image_raw"));
    }
}
