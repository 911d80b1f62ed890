//! One page that shows a run.

mod document;
mod figures;
mod frame;
mod scene;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use prehend_geometry::TriMesh;
use prehend_render::RgbImage;
use serde_json::json;

pub use self::document::{Chart, Column, Series};
use self::document::{Document, LabeledPicture};
pub use self::figures::{flags, least_sure, pose_figures};
pub use self::frame::{DrawnFrame, FrameDrawing, FrameReport};
use self::frame::{loss_chart, residuals};
use self::scene::{encoded_hand, encoded_scene, object_mesh};
use super::picture::compared;
use crate::data::AssetError;
use crate::data::bop::{DatasetError, create_folder, write_atomically};
use crate::error::RefineError;
use crate::scene::{Hand, Object};

/// Parts of the page; style, data and scripts replace their marks in the skeleton.
const SKELETON: &str = include_str!("page/index.html");
const STYLE: &str = include_str!("page/style.css");
const SCRIPTS: [&str; 8] = [
    include_str!("page/dom.js"),
    include_str!("page/chart.js"),
    include_str!("page/slider.js"),
    include_str!("page/taxels.js"),
    include_str!("page/scene.js"),
    include_str!("page/detail.js"),
    include_str!("page/frames.js"),
    include_str!("page/main.js"),
];

/// Quality of pictures, of 100.
const QUALITY: u8 = 85;

/// A folder with an `index.html` that needs nothing else: pictures, meshes, style and scripts are in it.
pub struct Report {
    folder: PathBuf,
    document: Document,
    /// Objects that were drawn, as they were, and the numbers of their meshes.
    objects: Vec<(Arc<Object>, TriMesh, usize)>,
    /// Hands that were drawn, by their numbers.
    hands: Vec<Arc<Hand>>,
}

impl Report {
    /// Makes the folder.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn create(folder: &Path, title: &str) -> Result<Self, DatasetError> {
        create_folder(folder)?;
        let document = Document { title: title.to_owned(), ..Document::default() };
        let (objects, hands) = (Vec::new(), Vec::new());
        Ok(Self { folder: folder.into(), document, objects, hands })
    }

    /// Adds something to say of the whole run: what, and a figure or a few words.
    pub fn add_fact(&mut self, what: &str, value: impl Into<String>) {
        self.document.facts.push([what.to_owned(), value.into()]);
    }

    /// Adds a table: a heading a column, and rows of as many cells.
    pub fn add_table<S: Into<String>>(
        &mut self,
        title: &str,
        headings: impl IntoIterator<Item = S>,
        rows: impl IntoIterator<Item = impl Into<Vec<String>>>,
    ) {
        let headings: Vec<String> = headings.into_iter().map(Into::into).collect();
        let rows: Vec<Vec<String>> = rows.into_iter().map(Into::into).collect();
        let table = json!({ "kind": "table", "title": title, "headings": headings, "rows": rows });
        self.document.blocks.push(table);
    }

    /// Adds a picture with remarks.
    ///
    /// # Errors
    /// If the picture cannot be encoded.
    pub fn add_picture(
        &mut self,
        title: &str,
        picture: &RgbImage,
        remarks: &[String],
    ) -> Result<(), RefineError> {
        let picture = jpeg(picture)?;
        let block =
            json!({ "kind": "picture", "title": title, "remarks": remarks, "picture": picture });
        self.document.blocks.push(block);
        Ok(())
    }

    /// Adds two pictures of the same, before and after, over each other.
    ///
    /// # Errors
    /// If a picture cannot be encoded.
    pub fn add_comparison(
        &mut self,
        title: &str,
        pictures: &[RgbImage; 2],
    ) -> Result<(), RefineError> {
        let pictures = labeled(["before", "after"], pictures)?;
        let block = json!({ "kind": "comparison", "title": title, "pictures": pictures });
        self.document.blocks.push(block);
        Ok(())
    }

    /// Adds curves.
    pub fn add_chart(&mut self, chart: Chart) {
        self.document.charts.push(chart);
    }

    /// Adds a frame.
    pub fn add_frame(&mut self, frame: FrameReport) {
        let columns = &mut self.document.columns;
        for (column, _) in &frame.figures {
            if !columns.contains(column) {
                columns.push(*column);
            }
        }
        self.document.frames.push(frame);
    }

    /// Draws what there is of a frame, for [`add_frame`](Self::add_frame).
    ///
    /// # Errors
    /// If the frame or one of its pictures is broken.
    pub fn draw(&mut self, drawing: &FrameDrawing<'_>) -> Result<DrawnFrame, AssetError> {
        let FrameDrawing { input, initial, t_cam_object, trace, .. } = drawing;
        let (observation, object) = (&input.frame, &input.object);
        let labels = if initial.is_some() { ["initial", "refined"] } else { ["image", "outline"] };
        let pictures = labeled(labels, &compared(observation, object, *initial, t_cam_object));
        let hand = observation.hand.as_ref().map(|measured| self.hand(&measured.hand));
        let index = self.object(object);
        let (_, mesh, number) = &self.objects[index];
        Ok(DrawnFrame {
            pictures: pictures?,
            residuals: residuals(drawing)?,
            chart: trace.and_then(loss_chart),
            scene: encoded_scene(drawing, mesh, *number, hand)?,
        })
    }

    /// Where `object` is among those that were drawn.
    fn object(&mut self, object: &Arc<Object>) -> usize {
        let known = self.objects.iter().position(|(known, ..)| Arc::ptr_eq(known, object));
        known.unwrap_or_else(|| {
            let (mesh, encoded) = object_mesh(&object.mesh);
            self.objects.push((Arc::clone(object), mesh, self.document.meshes.len()));
            self.document.meshes.push(encoded);
            self.objects.len() - 1
        })
    }

    /// The number of `hand`.
    fn hand(&mut self, hand: &Arc<Hand>) -> usize {
        let known = self.hands.iter().position(|known| Arc::ptr_eq(known, hand));
        known.unwrap_or_else(|| {
            let encoded = encoded_hand(hand, &mut self.document.meshes);
            self.document.hands.push(encoded);
            self.hands.push(Arc::clone(hand));
            self.hands.len() - 1
        })
    }

    /// Writes the page and returns its path.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(mut self) -> Result<PathBuf, DatasetError> {
        let Document { columns, frames, .. } = &mut self.document;
        let figures = || frames.iter().flat_map(|frame| &frame.figures);
        columns.retain(|column| figures().any(|(own, value)| own == column && value.is_some()));
        let file = self.folder.join("index.html");
        let fail = |e: serde_json::Error| DatasetError::writing(&file, e);
        // Nothing in it may end the element that it is in, or begin a comment there.
        let data = serde_json::to_string(&self.document).map_err(fail)?.replace('<', "\\u003c");
        let mut page = String::with_capacity(data.len() + 100_000);
        let mut rest = SKELETON;
        for (mark, content) in
            [("{{STYLE}}", STYLE), ("{{DATA}}", &data), ("{{SCRIPTS}}", &SCRIPTS.concat())]
        {
            let (before, after) = rest.split_once(mark).unwrap_or((rest, ""));
            page += before;
            page += content;
            rest = after;
        }
        page += rest;
        write_atomically(&file, page.as_bytes())?;
        Ok(file)
    }
}

fn labeled(
    labels: [&str; 2],
    [first, second]: &[RgbImage; 2],
) -> Result<[LabeledPicture; 2], RefineError> {
    let picture = |label: &str, image| {
        Ok::<_, RefineError>(LabeledPicture { label: label.to_owned(), picture: jpeg(image)? })
    };
    Ok([picture(labels[0], first)?, picture(labels[1], second)?])
}

/// The picture as a `data:` URI.
fn jpeg(picture: &RgbImage) -> Result<String, RefineError> {
    let bytes = picture.to_jpeg(QUALITY).map_err(|e| RefineError::Images(e.to_string()))?;
    Ok(format!("data:image/jpeg;base64,{}", STANDARD.encode(bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_is_whole_and_nothing_in_its_data_ends_them() {
        let dir = tempfile::tempdir().unwrap();
        let mut report = Report::create(dir.path(), "a <!--<script></script> in a title").unwrap();
        report.add_fact("frames", "1");
        let page = std::fs::read_to_string(report.finish().unwrap()).unwrap();
        assert!(page.ends_with("</html>\n") && !page.contains("{{"));
        assert!(page.contains(r"a \u003c!--\u003cscript>\u003c/script> in a title"));
        // The data's element and the scripts'.
        assert_eq!(page.matches("</script>").count(), 2);
        let fetched = ["src=\"http", "href=\"http", "@import", "fetch("];
        assert!(fetched.iter().all(|text| !page.contains(text)), "it needs the network");
    }
}
