//! The manifest at the end of a file, which lists its recordings and chunks for random access.

use re_log_encoding::{
    CodecError, Decodable as _, Encodable as _, EncodeError, MessageHeader, MessageKind,
    RawRrdManifest, StreamFooter, ToApplication as _, ToTransport as _,
};
use re_protos::log_msg::v1alpha1::RrdFooter;

use crate::recording::stream::RecordingFault;

/// Sorts the manifest of a file: recordings by id, columns by name. The format does not define the
/// order, and the library writes a different one each time.
///
/// # Errors
/// The file has no manifest.
pub(super) fn sorted(file: Vec<u8>) -> Result<Vec<u8>, RecordingFault> {
    Ok(with_sorted_list(file).map_err(EncodeError::from)?)
}

fn with_sorted_list(mut file: Vec<u8>) -> Result<Vec<u8>, CodecError> {
    let end = file.len().saturating_sub(StreamFooter::ENCODED_SIZE_BYTES);
    let footer = StreamFooter::from_rrd_bytes(file.get(end..).unwrap_or_default())?;
    let place = footer
        .entries
        .first()
        .map(|entry| entry.rrd_footer_byte_span_from_start_excluding_header);
    let start = place.map_or(end, |place| place.start as usize);
    let list = in_order(RrdFooter::from_rrd_bytes(
        file.get(start..end).unwrap_or_default(),
    )?)?;
    let mut listed = Vec::new();
    list.to_rrd_bytes(&mut listed)?;
    file.truncate(start.saturating_sub(MessageHeader::ENCODED_SIZE_BYTES));
    MessageHeader {
        kind: MessageKind::End,
        len: listed.len() as u64,
    }
    .to_rrd_bytes(&mut file)?;
    file.extend(&listed);
    StreamFooter::from_rrd_footer_bytes(start as u64, &listed).to_rrd_bytes(&mut file)?;
    Ok(file)
}

fn in_order(list: RrdFooter) -> Result<RrdFooter, CodecError> {
    let manifests = list
        .manifests
        .iter()
        .map(|manifest| manifest.to_application(()));
    let mut manifests = manifests.collect::<Result<Vec<RawRrdManifest>, CodecError>>()?;
    manifests.sort_by(|a, b| a.store_id.cmp(&b.store_id));
    for manifest in &mut manifests {
        let mut fields = manifest.sorbet_schema.fields.to_vec();
        fields.sort();
        manifest.sorbet_schema.fields = fields.into();
    }
    let manifests = manifests.iter().map(|manifest| manifest.to_transport(()));
    Ok(RrdFooter {
        manifests: manifests.collect::<Result<_, CodecError>>()?,
    })
}
