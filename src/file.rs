//! Reading whole files that may be anything, and writing files that are whole or not there.

use std::fs::File;
use std::io::{BufWriter, Error, Read, Result, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

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

/// Writes a file that appears under its name when it is whole and on disk; until then what had that name stays as it was.
///
/// # Errors
/// What `content` or the system says; a name that is a device or a pipe, which would be replaced.
pub(crate) fn write_whole(path: &Path, content: impl FnOnce(&mut BufWriter<&mut File>) -> Result<()>) -> Result<()> {
    // A symbolic link keeps its place.
    let path: PathBuf = match path.metadata() {
        Ok(data) if !data.is_file() => return Err(Error::other("it is there already and no regular file")),
        Ok(_) => path.canonicalize()?,
        Err(_) => path.to_owned(),
    };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".tress-");
    // Temporary files are private by default; this one is to become an ordinary file, as the umask says.
    builder.permissions(PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder)?;
    let mut out = BufWriter::with_capacity(1 << 20, file.as_file_mut());
    content(&mut out)?;
    out.flush()?;
    drop(out);
    file.as_file().sync_all()?;
    file.persist(&path).map_err(|e| e.error)?;
    // The new name is only safe once the folder is; some file systems do not let a folder be flushed.
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
    Ok(())
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
}
