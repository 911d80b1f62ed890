//! Files named by other files: read from the folder of the file that names them, and from nowhere else.

use std::path::{Component, Path, PathBuf};

/// Error message for a name that leads out of the folder.
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
    /// As `Own`, and files of packages in folders above that are called like them.
    Package,
    /// In this folder, above it, or below.
    Within(PathBuf),
    Anywhere,
}

impl Folder {
    /// A folder alone.
    pub(crate) fn own(path: &Path) -> Self {
        Self { path: path.to_path_buf(), reach: Reach::Own }
    }

    /// A folder, with the packages that it lies in.
    pub(crate) fn in_packages(path: &Path) -> Self {
        Self { path: path.to_path_buf(), reach: Reach::Package }
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
        let path = self.path.join(name.trim().replace('\\', "/"));
        let (root, outside) = match &self.reach {
            Reach::Anywhere => return Ok(path),
            Reach::Within(root) => (root, "the path leaves the root of the file's package"),
            // Absolute names may lead into the folder.
            _ if Path::new(name.trim()).is_absolute() => (&self.path, OUTSIDE),
            _ => return inside(&self.path, name),
        };
        let root = root.canonicalize().map_err(|_| "the root folder does not exist")?;
        match path.canonicalize() {
            Ok(file) if !file.starts_with(&root) => Err(outside),
            // What does not exist has no content that could be given away.
            _ => Ok(path),
        }
    }

    /// The file `name` of `package`, in the nearest folder upwards that is called so and has it.
    pub(crate) fn packaged(&self, package: &str, name: &str) -> Option<PathBuf> {
        let Reach::Package = self.reach else { return None };
        let own = self.path.canonicalize().ok()?;
        let is_called = |folder: &&Path| folder.file_name().is_some_and(|own| own == package);
        let mut packages = own.ancestors().filter(is_called);
        packages.find_map(|folder| inside(folder, name).ok().filter(|file| file.is_file()))
    }
}

/// A URI with the characters that it writes as `%20`.
pub(crate) fn percent_decoded(uri: &str) -> String {
    let (mut out, mut rest) = (Vec::new(), uri.as_bytes());
    while let Some((&first, tail)) = rest.split_first() {
        let digits = tail.get(..2).filter(|h| first == b'%' && h.iter().all(u8::is_ascii_hexdigit));
        let hex = digits.and_then(|h| u8::from_str_radix(str::from_utf8(h).ok()?, 16).ok());
        out.push(hex.unwrap_or(first));
        rest = if hex.is_some() { &tail[2..] } else { tail };
    }
    String::from_utf8_lossy(&out).into_owned()
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
    fn uris_are_decoded() {
        assert_eq!(percent_decoded("a%20b%2Fc%C3%A4"), "a b/cä");
        assert_eq!(percent_decoded("50%, %zz%+1%2"), "50%, %zz%+1%2");
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
        let absolute = |name: &str| root.path().join(name).display().to_string();
        assert!(Folder::own(&folder).file(&absolute("package/robots/own")).is_ok());
        assert_eq!(Folder::own(&folder).file(&absolute("package/mesh")), Err(OUTSIDE));
        // A package without a mark of its root is known by its name.
        let marked = Folder::in_packages(&folder);
        let mesh = root.path().canonicalize().unwrap().join("package/mesh");
        assert_eq!(marked.packaged("package", "mesh"), Some(mesh));
        assert_eq!(marked.packaged("package", "../secret"), None);
        assert_eq!(marked.packaged("other", "mesh"), None);
        assert_eq!(marked.file("../mesh"), Err(OUTSIDE));
        assert_eq!(Folder::own(&folder).packaged("package", "mesh"), None);
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
