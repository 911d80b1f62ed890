//! The text before the values: which elements follow, with which properties, in which encoding.

use std::path::Path;

use crate::io::limits::MAX_PLY_HEADER;
use crate::io::{MeshError, Result};

/// Most kinds of elements, real files have four at most.
const MAX_KINDS: usize = 256;

#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum PlyNumber {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl PlyNumber {
    pub(super) fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Color in 0..=1 from a stored `value`: integers of 8 or 16 bits over 255 or 65535, others as they are.
    pub(super) fn color(self, value: f64) -> f32 {
        let full = match self {
            Self::U8 | Self::I8 => 255.0,
            Self::U16 | Self::I16 => 65535.0,
            _ => 1.0,
        };
        (value / full) as f32
    }

    pub(super) fn decode(self, bytes: &[u8], big_endian: bool) -> Option<f64> {
        let mut b = [0_u8; 8];
        let n = self.size();
        b.get_mut(..n)?.copy_from_slice(bytes.get(..n)?);
        if big_endian {
            b[..n].reverse();
        }
        let [b0, b1, b2, b3, ..] = b;
        Some(match self {
            Self::I8 => f64::from(b0 as i8),
            Self::U8 => f64::from(b0),
            Self::I16 => f64::from(i16::from_le_bytes([b0, b1])),
            Self::U16 => f64::from(u16::from_le_bytes([b0, b1])),
            Self::I32 => f64::from(i32::from_le_bytes([b0, b1, b2, b3])),
            Self::U32 => f64::from(u32::from_le_bytes([b0, b1, b2, b3])),
            Self::F32 => f64::from(f32::from_le_bytes([b0, b1, b2, b3])),
            Self::F64 => f64::from_le_bytes(b),
        })
    }
}

pub(super) struct Property {
    pub(super) name: String,
    /// The type of the length, for a list.
    pub(super) count: Option<PlyNumber>,
    pub(super) item: PlyNumber,
}

pub(super) struct PlyElement {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Encoding {
    Ascii,
    Binary { big_endian: bool },
}

pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<PlyElement>,
    pub(super) texture: Option<String>,
    pub(super) length: usize,
}

pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Header> {
    let bad = |reason: String| MeshError::malformed(path, "header", reason);
    let (mut encoding, mut elements, mut textures) = (None, Vec::<PlyElement>::new(), Vec::new());
    let mut at = 0;
    let mut first = true;
    loop {
        let rest = bytes.get(at..).unwrap_or_default();
        let Some(end) = rest.iter().position(|&b| b == b'\n') else {
            return Err(bad("no end_header: truncated, or not a PLY file".into()));
        };
        at += end + 1;
        if at > MAX_PLY_HEADER {
            return Err(bad(format!("longer than {MAX_PLY_HEADER} bytes")));
        }
        let line = String::from_utf8_lossy(&rest[..end]);
        let line = line.trim();
        let words: Vec<&str> = line.split_whitespace().collect();
        if std::mem::take(&mut first) {
            if line != "ply" {
                return Err(bad("the first line is not `ply`".into()));
            }
            continue;
        }
        match words.as_slice() {
            ["end_header"] => break,
            ["format", name, _version] => {
                encoding = Some(match *name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::Binary { big_endian: false },
                    "binary_big_endian" => Encoding::Binary { big_endian: true },
                    _ => return Err(bad(format!("unknown format `{name}`"))),
                });
            }
            ["comment", "TextureFile", ..] => {
                let name =
                    line.split_once("TextureFile").map_or("", |(_, name)| name.trim()).to_owned();
                textures.push(name);
            }
            ["element", name, count] => {
                if elements.len() == MAX_KINDS {
                    return Err(bad(format!("more than {MAX_KINDS} kinds of elements")));
                }
                let count =
                    count.parse().map_err(|_| bad(format!("element {name}: count `{count}`")))?;
                if elements.iter().any(|e| e.name == *name) {
                    return Err(bad(format!("element {name} declared twice")));
                }
                elements.push(PlyElement { name: (*name).into(), count, properties: Vec::new() });
            }
            ["property", rest @ ..] => {
                let property = match rest {
                    ["list", count, item, name] => {
                        (Some(PlyNumber::named(count)), PlyNumber::named(item), name)
                    }
                    [item, name] => (None, PlyNumber::named(item), name),
                    _ => return Err(bad(format!("cannot read `{line}`"))),
                };
                let (count, Some(item), name) = property else {
                    return Err(bad(format!("type in `{line}`")));
                };
                let count =
                    count.map(|c| c.ok_or_else(|| bad(format!("type in `{line}`")))).transpose()?;
                let element = elements
                    .last_mut()
                    .ok_or_else(|| bad("a property before any element".into()))?;
                element.properties.push(Property { name: (*name).into(), count, item });
            }
            [] | ["comment" | "obj_info", ..] => {}
            _ => log::warn!("{}: header: `{line}` is passed over", path.display()),
        }
    }
    let encoding = encoding.ok_or_else(|| bad("no format line".into()))?;
    // Which face has which of several is not read.
    let texture = match textures.len() {
        0 | 1 => textures.pop(),
        several => {
            log::warn!("{}: {several} textures: none is used", path.display());
            None
        }
    };
    Ok(Header { encoding, elements, texture, length: at })
}
