//! Buffers: from the binary chunk, from data URIs, from files.

use std::path::PathBuf;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gltf::json::Root;

use crate::error::{LoadError, Source};
use crate::import::reader;

/// The bytes of every buffer, as many as it claims to have.
pub(super) fn load(source: Source, root: &Root, binary: Option<&[u8]>) -> Result<Vec<Vec<u8>>, LoadError> {
    let mut buffers = Vec::with_capacity(root.buffers.len());
    for (index, buffer) in root.buffers.iter().enumerate() {
        let place = format!("buffers[{index}]");
        let bytes = match (&buffer.uri, binary) {
            (Some(uri), _) => fetch(source, uri).map_err(|message| source.broken(&place, message))?,
            (None, Some(binary)) if index == 0 => binary.to_vec(),
            (None, _) => {
                return Err(source.broken(place, "it has neither a URI nor a binary chunk: export it again"));
            }
        };
        if (bytes.len() as u64) < buffer.byte_length.0 {
            let message = format!(
                "truncated: {} bytes are needed, there are {}: get the file again",
                buffer.byte_length.0,
                bytes.len()
            );
            return Err(source.broken(place, message));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// What a URI stands for: a data URI or a file beside the scene's own.
pub(super) fn fetch(source: Source, uri: &str) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (kind, payload) = data.split_once(',').ok_or("a data URI without a comma")?;
        if !kind.ends_with(";base64") {
            return Err("a data URI that is not base64: export it as a file or in base64".to_owned());
        }
        return STANDARD.decode(payload.trim()).map_err(|error| format!("bad base64: {error}"));
    }
    let path = beside(source, uri)?;
    reader::named(&path).map_err(|error| {
        format!(
            "cannot read {}: {error}; put the file there, or export with everything embedded",
            path.display()
        )
    })
}

fn beside(source: Source, uri: &str) -> Result<PathBuf, String> {
    if uri.contains("://") {
        return Err(format!("{uri}: only files and data URIs are read, nothing is fetched"));
    }
    let name = unescape(uri).ok_or_else(|| format!("{uri}: a bad percent escape"))?;
    Ok(source.path.parent().map_or_else(|| PathBuf::from(&name), |folder| folder.join(&name)))
}

/// Undoes percent escapes.
fn unescape(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        if *first == b'%' {
            let digits = std::str::from_utf8(tail.get(..2)?).ok()?;
            bytes.push(u8::from_str_radix(digits, 16).ok()?);
            rest = &tail[2..];
        } else {
            bytes.push(*first);
            rest = tail;
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::unescape;

    #[test]
    fn percent_escapes_are_undone() {
        assert_eq!(unescape("a%20b.bin").as_deref(), Some("a b.bin"));
        assert_eq!(unescape("100%"), None);
        assert_eq!(unescape("%zz"), None);
    }
}
