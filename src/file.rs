//! Reading whole files that may be anything, and writing files that are whole or not there.

use std::ffi::OsStr;
use std::fs::File;
use std::io::{BufWriter, Error, Read, Result, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use tempfile::TempPath;

/// The whole of a regular file, unless it has more than `limit` bytes.
///
/// # Errors
/// What the system says; what is no regular file, as a device or a pipe could go on for ever; a file that is too large
/// for the limit or for the memory.
pub(crate) fn read_regular(path: &Path, limit: u64) -> Result<Vec<u8>> {
    // Before it is opened: opening a named pipe waits for a writer.
    let data = path.metadata()?;
    if !data.is_file() {
        return Err(Error::other("it is not a regular file"));
    }
    let size = data.len();
    if size > limit {
        return Err(Error::other(format!("it has {size} bytes, more than the limit of {limit}")));
    }
    let mut bytes = Vec::new();
    let capacity = usize::try_from(size).map_err(Error::other)?;
    bytes.try_reserve_exact(capacity).map_err(Error::other)?;
    // A file may grow while it is read: take no more than was agreed to.
    File::open(path)?.take(size).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// How the names of temporary files begin.
const PREFIX: &str = ".tress-";
/// Characters after the prefix, all letters and digits.
const RANDOM: usize = 6;
/// A temporary file that was not changed for this long, and that no process holds, was left by one that was killed.
const LEFT_AFTER: Duration = Duration::from_secs(3600);

/// A file that is to take another's place when it is whole. It goes when it is dropped; what a killed process left of it goes
/// with the next one that is made beside it.
#[derive(Debug)]
pub(crate) struct Temporary {
    /// Holds the lock that says that somebody is still at work.
    file: File,
    path: TempPath,
}

impl Temporary {
    /// A new, empty file in a folder; its name ends in `suffix`, which may be empty.
    ///
    /// # Errors
    /// The system's.
    pub fn in_folder(folder: &Path, suffix: &str) -> Result<Self> {
        remove_left_over(folder);
        let (file, path) = tempfile::Builder::new()
            .prefix(PREFIX)
            .rand_bytes(RANDOM)
            .suffix(suffix)
            // Temporary files are private by default; this one is to become an ordinary file, as the umask says.
            .permissions(PermissionsExt::from_mode(0o666))
            .tempfile_in(folder)?
            .into_parts();
        // Where there are no locks the age alone says that nobody is at work; then nothing is removed.
        let _ = file.try_lock();
        Ok(Self { file, path })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn file(&mut self) -> &mut File {
        &mut self.file
    }

    /// Flushes the file to the disk and gives it the name `target`, which stays as it is if that fails.
    ///
    /// # Errors
    /// The system's.
    pub fn persist(self, target: &Path) -> Result<()> {
        // By name: whoever filled the file may have opened it anew.
        File::open(&self.path)?.sync_all()?;
        self.path.persist(target).map_err(|e| e.error)?;
        // The new name is only safe once the folder is; some file systems do not let a folder be flushed.
        if let Err(error) = File::open(folder_of(target)).and_then(|folder| folder.sync_all()) {
            tracing::debug!(target = %target.display(), %error, "cannot flush the folder");
        }
        Ok(())
    }
}

/// Removes what killed processes left in a folder: old, of our form, and locked by nobody. Failures are no matter.
fn remove_left_over(folder: &Path) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let is_old = |data: std::fs::Metadata| {
            let age = data.modified().ok().and_then(|time| SystemTime::now().duration_since(time).ok());
            data.is_file() && age.is_some_and(|age| age > LEFT_AFTER)
        };
        // The name first: it costs no call to the system. The data are of a link itself, never of what it leads to.
        if !is_temporary(&entry.file_name()) || !entry.metadata().is_ok_and(is_old) {
            continue;
        }
        let path = entry.path();
        let free = File::options().write(true).open(&path).is_ok_and(|file| file.try_lock().is_ok());
        if free && std::fs::remove_file(&path).is_ok() {
            tracing::info!("removed {}, left by a run that was killed", path.display());
        }
    }
}

/// Whether a name is one of ours: prefix, six letters and digits, and nothing or an ending.
fn is_temporary(name: &OsStr) -> bool {
    let Some(rest) = name.to_str().and_then(|name| name.strip_prefix(PREFIX)) else { return false };
    let bytes = rest.as_bytes();
    let random = bytes.get(..RANDOM).is_some_and(|part| part.iter().all(u8::is_ascii_alphanumeric));
    random && matches!(bytes.get(RANDOM), None | Some(b'.'))
}

/// The folder that a file is in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// The file that a name leads to, which is to be replaced: a symbolic link keeps its place.
///
/// # Errors
/// A folder, device or pipe of that name; a file that nobody may write, which its owner wants to keep.
pub(crate) fn replaceable(path: &Path) -> Result<PathBuf> {
    match path.metadata() {
        Ok(data) if data.is_dir() => Err(Error::other("it is a folder; name a file in it")),
        Ok(data) if !data.is_file() => Err(Error::other("it is there already and no regular file")),
        // The folder alone decides whether a file can be replaced, so the system would not object.
        Ok(data) if data.permissions().readonly() => {
            Err(Error::other("it is there already and read-only; make it writable (chmod u+w) or give another name"))
        }
        Ok(_) => path.canonicalize(),
        Err(_) => Ok(path.to_owned()),
    }
}

/// Writes a file that appears under its name when it is whole and on disk; until then what had that name stays as it was.
///
/// # Errors
/// What `content` or the system says; a name that is a folder, a device or a pipe, or a read-only file's.
pub(crate) fn write_whole(path: &Path, content: impl FnOnce(&mut BufWriter<&mut File>) -> Result<()>) -> Result<()> {
    let path = replaceable(path)?;
    let mut temporary = Temporary::in_folder(folder_of(&path), "")?;
    let mut out = BufWriter::with_capacity(1 << 20, temporary.file());
    content(&mut out)?;
    out.flush()?;
    drop(out);
    temporary.persist(&path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_below_the_limit_are_read() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), b"12345").unwrap();
        assert_eq!(read_regular(file.path(), 5).unwrap(), b"12345");
        assert!(read_regular(file.path(), 4).unwrap_err().to_string().contains("5 bytes"));
        assert!(read_regular(Path::new("/dev/zero"), 5).unwrap_err().to_string().contains("regular"));
        assert!(read_regular(&std::env::temp_dir(), 5).is_err());
    }

    #[test]
    fn files_are_replaced_whole_and_links_followed() {
        let folder = tempfile::tempdir().unwrap();
        let write = |path: &Path, text: &str| write_whole(path, |out| out.write_all(text.as_bytes()));
        let [file, link, null] = ["a.json", "b.json", "null.json"].map(|name| folder.path().join(name));
        write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write(&link, "new").unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), b"new");
        assert!(link.is_symlink());
        std::os::unix::fs::symlink("/dev/null", &null).unwrap();
        assert!(write(&null, "x").unwrap_err().to_string().contains("no regular file"));
        assert!(write(&folder.path().join("no/a.json"), "x").is_err());
        let broken = write_whole(&file, |out| out.write_all(b"half").and(Err(Error::other("broken"))));
        assert_eq!(
            (broken.unwrap_err().to_string(), std::fs::read(&file).unwrap()),
            ("broken".to_owned(), b"new".to_vec())
        );
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3, "no temporary file is left");
    }

    #[test]
    fn what_killed_runs_left_goes_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let old = SystemTime::now() - 2 * LEFT_AFTER;
        let make = |name: &str, time: SystemTime| {
            let path = folder.path().join(name);
            let file = File::create(&path).unwrap();
            file.set_modified(time).unwrap();
            (path, file)
        };
        let left = [".tress-aB3dE6", ".tress-aB3dE6.exr"].map(|name| make(name, old).0);
        let others = ["tress-aB3dE6", ".tress-notes.txt", ".tress-aB3dE67", ".tress-"].map(|name| make(name, old).0);
        let young = make(".tress-aB3dE7.png", SystemTime::now()).0;
        let (held, file) = make(".tress-aB3dE8.png", old);
        file.try_lock().unwrap();
        let link = folder.path().join(".tress-aB3dE9");
        std::os::unix::fs::symlink(&others[0], &link).unwrap();
        drop(Temporary::in_folder(folder.path(), ".exr").unwrap());
        assert!(left.iter().all(|path| !path.exists()));
        for path in others.iter().chain([&young, &held, &link]) {
            assert!(path.exists(), "{}", path.display());
        }
        drop(file);
        drop(Temporary::in_folder(folder.path(), "").unwrap());
        assert!(!held.exists(), "its run ended");
    }

    #[test]
    fn read_only_files_and_folders_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        std::fs::write(&path, "good").unwrap();
        std::fs::set_permissions(&path, PermissionsExt::from_mode(0o444)).unwrap();
        let write = |path: &Path| write_whole(path, |out| out.write_all(b"x")).unwrap_err().to_string();
        assert!(write(&path).contains("read-only"));
        assert_eq!(std::fs::read(&path).unwrap(), b"good");
        assert!(write(folder.path()).contains("folder"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
