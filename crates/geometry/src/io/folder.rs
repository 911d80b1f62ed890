//! Files named by other files: read from the folder of the file that names them, and from nowhere else.

use std::path::{Component, Path, PathBuf};

/// What an error says about a name that leads elsewhere.
pub(crate) const OUTSIDE: &str = "the path leaves the folder of the file that names it";

/// The file `name` in `folder` or below it, whether or not it exists.
///
/// Refused are absolute names, names with `..`, and symbolic links on the way that lead outside of the folder (those
/// that stay within are followed). The folder itself may be reached through links.
pub(crate) fn inside(folder: &Path, name: &str) -> Result<PathBuf, &'static str> {
    // Files written on Windows separate folders by backslashes.
    let relative = PathBuf::from(name.trim().replace('\\', "/"));
    let descends =
        relative.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    if !descends || relative.as_os_str().is_empty() {
        return Err(OUTSIDE);
    }
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let path = folder.join(relative);
    // What does not exist has no real path, and no content that could be given away.
    match (path.canonicalize(), folder.canonicalize()) {
        (Ok(file), Ok(root)) if !file.starts_with(&root) => Err(OUTSIDE),
        _ => Ok(path),
    }
}

/// A folder, and how far from it files may lie that a file in it names.
#[derive(Clone, Debug)]
pub(crate) struct Folder {
    pub(crate) path: PathBuf,
    reach: Reach,
}

#[derive(Clone, Debug)]
enum Reach {
    /// In the folder or below.
    Own,
    /// In this folder, above it, or below.
    Within(PathBuf),
    Anywhere,
}

impl Folder {
    /// A folder alone.
    pub(crate) fn own(path: &Path) -> Self {
        Self { path: path.to_path_buf(), reach: Reach::Own }
    }

    /// A folder with all that is in `root`.
    pub(crate) fn within(path: &Path, root: &Path) -> Self {
        Self { path: path.to_path_buf(), reach: Reach::Within(root.to_path_buf()) }
    }

    /// A folder with all that there is.
    pub(crate) fn anywhere(path: &Path) -> Self {
        Self { path: path.to_path_buf(), reach: Reach::Anywhere }
    }

    /// The file `name`, seen from the folder, whether or not it exists.
    pub(crate) fn file(&self, name: &str) -> Result<PathBuf, &'static str> {
        let root = match &self.reach {
            Reach::Own => return inside(&self.path, name),
            Reach::Within(root) => Some(root),
            Reach::Anywhere => None,
        };
        let path = self.path.join(name.trim().replace('\\', "/"));
        let Some(root) = root else { return Ok(path) };
        let root = root.canonicalize().map_err(|_| "the root folder does not exist")?;
        match path.canonicalize() {
            Ok(file) if file.starts_with(&root) => Ok(path),
            Ok(_) => Err("the path leaves the root of the file's package"),
            // What does not exist has no content that could be given away.
            Err(_) => Ok(path),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_inside_the_folder() {
        let folder = Path::new("models");
        assert_eq!(inside(folder, "./tex\\a.png").unwrap(), Path::new("models/tex/a.png"));
        for name in ["../a.png", "/etc/passwd", "x/../../a.png", "", "..\\a.png"] {
            assert_eq!(inside(folder, name), Err(OUTSIDE), "{name}");
        }
        assert_eq!(inside(Path::new(""), "a.png").unwrap(), Path::new("./a.png"));
    }

    #[test]
    fn a_package_reaches_to_its_root() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("package/robots");
        std::fs::create_dir_all(&folder).unwrap();
        for name in ["secret", "package/mesh", "package/robots/own"] {
            std::fs::write(root.path().join(name), "x").unwrap();
        }
        let within = Folder::within(&folder, &root.path().join("package"));
        assert!(within.file("../mesh").is_ok() && within.file("own").is_ok());
        assert!(within.file("../../secret").is_err());
        assert!(Folder::anywhere(&folder).file("../../secret").is_ok());
        assert_eq!(Folder::own(&folder).file("../mesh"), Err(OUTSIDE));
    }

    #[cfg(unix)]
    #[test]
    fn links_may_not_lead_out() {
        use std::os::unix::fs::symlink;
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("asset");
        std::fs::create_dir_all(folder.join("sub")).unwrap();
        std::fs::write(root.path().join("secret"), "x").unwrap();
        std::fs::write(folder.join("own"), "y").unwrap();
        symlink(root.path().join("secret"), folder.join("out")).unwrap();
        symlink(root.path(), folder.join("up")).unwrap();
        symlink(folder.join("own"), folder.join("sub/again")).unwrap();
        for name in ["out", "up/secret"] {
            assert_eq!(inside(&folder, name), Err(OUTSIDE), "{name}");
        }
        assert!(inside(&folder, "sub/again").is_ok());
        // A folder that is itself reached through a link is one like any other.
        symlink(&folder, root.path().join("link")).unwrap();
        assert!(inside(&root.path().join("link"), "own").is_ok());
    }
}
