//! What can go wrong with an image, split by whose fault it is.

use std::io;
use std::path::{Path, PathBuf};

/// Every variant carries the file it is about.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io { path: PathBuf, action: &'static str, source: io::Error },
    /// A directory, pipe or device where a file is needed.
    #[error("{}: not a regular file; images are read from and written to files only", path.display())]
    NotAFile { path: PathBuf },
    /// The file's first bytes belong to none of the formats.
    #[error("{}: not an image in a format Tress reads (EXR, Radiance HDR, PNG, JPEG, TIFF)", path.display())]
    UnknownFormat { path: PathBuf },
    /// OpenImageIO's own message, or what it would say had it looked before it allocated.
    #[error("{}: cannot {action}: {message}", path.display())]
    Library { path: PathBuf, action: &'static str, message: String },
    /// More memory than [`super::Limits`] allow.
    #[error("{}: {what} of {bytes} bytes, more than the limit of {limit}; make it smaller, or replace the file if its header is damaged", path.display())]
    TooLarge { path: PathBuf, what: String, bytes: u128, limit: u64 },
    /// A header that promises more than any compression could hold in the file.
    #[error(
        "{}: its header claims {width}x{height} pixels, {bytes} bytes uncompressed, in a file of {file_bytes} bytes; the file is damaged or truncated",
        path.display()
    )]
    Implausible { path: PathBuf, width: u64, height: u64, bytes: u128, file_bytes: u64 },
    /// A valid file of a kind that is not supported.
    #[error("{}: {what}; {remedy}", path.display())]
    Unsupported { path: PathBuf, what: String, remedy: &'static str },
    /// A channel was asked for and is not there.
    #[error("{}: no {wanted} among its channels ({})", path.display(), present.join(", "))]
    MissingChannel { path: PathBuf, wanted: String, present: Vec<String> },
    /// The caller described an image that cannot be.
    #[error("{}: cannot write the image: {what}", path.display())]
    BadSpec { path: PathBuf, what: String },
    /// An extension without a writer.
    #[error(
        "{}: cannot tell the image format from {}; use one of .exr, .png, .jpg, .jpeg, .tif, .tiff",
        path.display(),
        extension.as_ref().map_or("a name without extension".to_owned(), |e| format!("the extension '.{e}'"))
    )]
    UnknownExtension { path: PathBuf, extension: Option<String> },
    /// What was written is not what is found in the file.
    #[error("{}: the file does not hold what was written to it ({what}); is the disk full?", path.display())]
    Damaged { path: PathBuf, what: String },
}

impl Error {
    /// For `map_err`.
    pub(super) fn io(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { path: path.to_owned(), action, source }
    }

    /// For `map_err`. OpenImageIO's messages may run over several lines and quote the name of `file`, which the user
    /// knows as `path` and need not read twice.
    pub(super) fn library(path: &Path, file: &Path, action: &'static str) -> impl FnOnce(String) -> Self {
        move |message| {
            let message = message.replace(&format!(" \"{}\"", file.display()), "");
            let message = message.split_whitespace().collect::<Vec<_>>().join(" ");
            Self::Library { path: path.to_owned(), action, message }
        }
    }
}
