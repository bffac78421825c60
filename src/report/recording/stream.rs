//! Writes one recording as a stream of messages with chunks of rows.

use re_chunk::{Chunk, ChunkError, ChunkId, RowId, TimeColumn, TimePoint, Timeline};
use re_log_encoding::{EncodeError, Encoder};
use re_log_types::{
    EntityPath, EntityPathPart, LogMsg, SetStoreInfo, StoreId, StoreInfo, StoreSource,
};
use re_sdk_types::{AsComponents, SerializationError, SerializedComponentColumn};

/// Application id; recordings of one application share their viewer settings.
const APPLICATION: &str = "actcheck";
/// Name of the only timeline: simulated time since the run began.
const SIM_TIME: &str = "sim_time";

/// Why something can't be recorded. No run should cause these errors, but the library can return
/// them.
#[derive(Debug, thiserror::Error)]
pub enum RecordingFault {
    /// Values can't be converted to columns.
    #[error("can't convert values to columns: {0}")]
    Values(#[from] SerializationError),
    /// Columns are inconsistent.
    #[error("inconsistent columns: {0}")]
    Columns(#[from] ChunkError),
    /// A message can't be encoded.
    #[error("can't encode a message: {0}")]
    Message(#[from] EncodeError),
}

/// A recording that is being written. Its ids are sequential, because they only need to be unique
/// within a recording.
pub(super) struct Recording<'a> {
    encoder: &'a mut Encoder<Vec<u8>>,
    store: StoreId,
    chunks: u128,
    rows: u128,
    bytes: u64,
}

impl<'a> Recording<'a> {
    /// Starts the recording of a run.
    ///
    /// # Errors
    /// The message can't be encoded.
    pub fn begin(encoder: &'a mut Encoder<Vec<u8>>, run: &str) -> Result<Self, RecordingFault> {
        let store = StoreId::recording(APPLICATION, run);
        let info = StoreInfo::new(store.clone(), StoreSource::Other(APPLICATION.to_owned()));
        let begun = LogMsg::SetStoreInfo(SetStoreInfo {
            row_id: RowId::ZERO.as_tuid(),
            info,
        });
        let bytes = encoder.append(&begun)?;
        Ok(Self {
            encoder,
            store,
            chunks: 0,
            rows: 0,
            bytes,
        })
    }

    /// Number of bytes written so far.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Logs static components.
    ///
    /// # Errors
    /// The components can't be converted or encoded.
    pub fn log_static(
        &mut self,
        at: EntityPath,
        what: &[&dyn AsComponents],
    ) -> Result<(), RecordingFault> {
        self.log(at, TimePoint::STATIC, what)
    }

    /// Logs components that hold from a moment on. Unit: seconds since the run began.
    ///
    /// # Errors
    /// The components can't be converted or encoded.
    pub fn log_at(
        &mut self,
        at: EntityPath,
        secs: f64,
        what: &dyn AsComponents,
    ) -> Result<(), RecordingFault> {
        self.log(
            at,
            TimePoint::default().with(Timeline::new_duration(SIM_TIME), nanos(secs)),
            &[what],
        )
    }

    fn log(
        &mut self,
        at: EntityPath,
        time: TimePoint,
        what: &[&dyn AsComponents],
    ) -> Result<(), RecordingFault> {
        let batches = what.iter().flat_map(|what| what.as_serialized_batches());
        let row = self.row();
        let chunk =
            Chunk::builder_with_id(self.chunk(), at).with_serialized_batches(row, time, batches);
        self.write(&chunk.build()?)
    }

    /// Logs a time series of components. Columns have one row for each moment. Unit: seconds since
    /// the run began.
    ///
    /// # Errors
    /// The components can't be converted or encoded.
    pub fn log_series(
        &mut self,
        at: EntityPath,
        secs: impl IntoIterator<Item = f64>,
        columns: impl IntoIterator<Item = SerializedComponentColumn>,
    ) -> Result<(), RecordingFault> {
        let nanos: Vec<i64> = secs.into_iter().map(nanos).collect();
        let rows: Vec<RowId> = nanos.iter().map(|_| self.row()).collect();
        let times = TimeColumn::new_duration_nanos(SIM_TIME, nanos);
        let timelines = std::iter::once((*times.timeline().name(), times)).collect();
        let components = columns
            .into_iter()
            .map(|column| (column.descriptor, column.list_array))
            .collect();
        let chunk =
            Chunk::from_native_row_ids(self.chunk(), at, Some(true), &rows, timelines, components)?;
        self.write(&chunk)
    }

    fn chunk(&mut self) -> ChunkId {
        self.chunks += 1;
        ChunkId::from_u128(self.chunks)
    }

    fn row(&mut self) -> RowId {
        self.rows += 1;
        RowId::from_u128(self.rows)
    }

    fn write(&mut self, chunk: &Chunk) -> Result<(), RecordingFault> {
        self.bytes += self
            .encoder
            .append(&LogMsg::ArrowMsg(self.store.clone(), chunk.to_arrow_msg()?))?;
        Ok(())
    }
}

/// Converts seconds to whole nanoseconds. NaN becomes 0.
fn nanos(secs: f64) -> i64 {
    (secs * 1e9).round() as i64
}

/// Entity path of the given parts. Names are used verbatim, whatever characters they contain.
pub(super) fn place<'a>(names: impl IntoIterator<Item = &'a str>) -> EntityPath {
    names.into_iter().map(EntityPathPart::new).collect()
}
