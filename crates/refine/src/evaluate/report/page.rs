//! One page that shows a run.

use std::path::{Path, PathBuf};

use nalgebra::Isometry3;
use prehend_render::RgbImage;

use super::curves::loss_curves;
use super::picture::before_and_after;
use crate::data::bop::{DatasetError, create_folder, write_atomically};
use crate::scene::{Object, Observation};
use crate::strategy::Trace;

/// The pictures of one refined frame.
pub struct FrameReport {
    /// The initial pose's outline beside the refined one's.
    picture: RgbImage,
    /// Loss curves, as SVG.
    curves: String,
    /// What to say below.
    caption: String,
}

impl FrameReport {
    /// Draws a refinement that began at `initial`.
    pub fn draw(
        observation: &Observation,
        object: &Object,
        initial: &Isometry3<f64>,
        (refined, iteration): (&Isometry3<f64>, usize),
        trace: &Trace,
    ) -> Self {
        let iterations = trace.iterations.len().saturating_sub(1);
        let moved = refined * object.center - initial * object.center;
        let turned = refined.rotation.angle_to(&initial.rotation).to_degrees();
        Self {
            picture: before_and_after(observation, object, initial, refined),
            curves: loss_curves(trace),
            caption: format!(
                "moved {:.1} mm and {turned:.1}°; pose of iteration {iteration} of {iterations}",
                moved.norm() * 1e3,
            ),
        }
    }
}

/// A folder of pictures with an `index.html`.
pub struct Report {
    folder: PathBuf,
    body: String,
    count: usize,
}

impl Report {
    /// Makes the folder.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn create(folder: &Path) -> Result<Self, DatasetError> {
        create_folder(folder)?;
        Ok(Self { folder: folder.into(), body: String::new(), count: 0 })
    }

    /// Adds a refined frame.
    ///
    /// # Errors
    /// If a picture cannot be written.
    pub fn add(&mut self, title: &str, frame: &FrameReport) -> Result<(), DatasetError> {
        let name = self.picture(&frame.picture)?;
        let curves = format!("{}.svg", name.trim_end_matches(".png"));
        write_atomically(&self.folder.join(&curves), frame.curves.as_bytes())?;
        let caption = escape(&frame.caption);
        self.section(
            title,
            &format!(
                "<p>{caption}</p><div><figure><img src=\"{name}\" alt=\"\">\
                 <figcaption><b class=before>initial</b> and <b class=after>refined</b> \
                 outline</figcaption></figure><img src=\"{curves}\" alt=\"loss curves\"></div>"
            ),
        );
        Ok(())
    }

    /// Adds a picture with remarks.
    ///
    /// # Errors
    /// If the picture cannot be written.
    pub fn add_picture(
        &mut self,
        title: &str,
        picture: &RgbImage,
        remarks: &[String],
    ) -> Result<(), DatasetError> {
        let name = self.picture(picture)?;
        let remarks: String = remarks.iter().map(|r| format!("<li>{}</li>", escape(r))).collect();
        self.section(title, &format!("<ul>{remarks}</ul><img src=\"{name}\" alt=\"\">"));
        Ok(())
    }

    /// Adds a table: a heading a column, and rows of as many cells.
    pub fn add_table(&mut self, title: &str, headings: &[&str], rows: &[Vec<String>]) {
        let cells = |tag: &str, cells: &mut dyn Iterator<Item = &str>| -> String {
            cells.map(|cell| format!("<{tag}>{}</{tag}>", escape(cell))).collect()
        };
        let head = cells("th", &mut headings.iter().copied());
        let row = |row: &Vec<String>| {
            format!("<tr>{}</tr>", cells("td", &mut row.iter().map(String::as_str)))
        };
        let rows: String = rows.iter().map(row).collect();
        self.section(title, &format!("<table><tr>{head}</tr>{rows}</table>"));
    }

    fn section(&mut self, title: &str, content: &str) {
        self.body += &format!("<section><h2>{}</h2>{content}</section>\n", escape(title));
    }

    /// Writes the page and returns its path.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(self) -> Result<PathBuf, DatasetError> {
        let page = self.folder.join("index.html");
        let html = format!("{HEAD}{}</body></html>\n", self.body);
        write_atomically(&page, html.as_bytes())?;
        Ok(page)
    }

    fn picture(&mut self, picture: &RgbImage) -> Result<String, DatasetError> {
        let name = format!("{:04}.png", self.count);
        self.count += 1;
        let file = self.folder.join(&name);
        picture.save(&file).map_err(|e| DatasetError::Write { file, problem: e.to_string() })?;
        Ok(name)
    }
}

const HEAD: &str = "<!doctype html><html lang=en><meta charset=utf-8><title>Prehend</title><style>\
    body{font:15px/1.4 system-ui,sans-serif;margin:2em auto;max-width:1400px;color:#222}\
    section{border-top:1px solid #ddd;padding:.5em 0}section>div{display:flex;flex-wrap:wrap;gap:1em}\
    h2{font-size:1.1em;margin:.5em 0}figure{margin:0}img{max-width:100%}\
    table{border-collapse:collapse}td,th{padding:.1em .8em;text-align:right}\
    td:first-child,th:first-child{text-align:left}.before{color:#d33}.after{color:#2a4}li{color:#a40}</style><body><h1>Prehend</h1>\n";

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
