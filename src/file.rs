//! Reading whole files that may be anything.

use std::fs::File;
use std::io::{Error, Read, Result};
use std::path::Path;

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
}
