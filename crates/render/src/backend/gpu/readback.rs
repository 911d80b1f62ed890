//! Bytes of a buffer, back from the device.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use super::device::Device;

/// How long a call back may take once the device is done.
const PATIENCE: Duration = Duration::from_secs(1);

/// Waits for a buffer's bytes.
pub(super) fn receive(
    device: &Device,
    buffer: &wgpu::Buffer,
    size: u64,
) -> Result<Vec<u8>, String> {
    let (sender, receiver) = channel();
    buffer.map_async(wgpu::MapMode::Read, ..size, move |result| {
        // Nobody listens any more if the device failed meanwhile.
        let _ = sender.send(result);
    });
    let poll =
        || device.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| e.to_string());
    poll()?;
    let done = Instant::now();
    loop {
        // The call may still be on its way in another thread, which polled for a session of its own.
        match receiver.recv_timeout(PATIENCE / 100) {
            Ok(mapped) => break mapped.map_err(|e| e.to_string())?,
            Err(RecvTimeoutError::Disconnected) => return Err("no answer".into()),
            // A lost device may never call back.
            Err(RecvTimeoutError::Timeout) if device.is_lost() || done.elapsed() > PATIENCE => {
                return Err("no answer".into());
            }
            Err(RecvTimeoutError::Timeout) => {
                poll()?;
            }
        }
    }
    let bytes = buffer.get_mapped_range(..size).map_err(|e| e.to_string())?.to_vec();
    buffer.unmap();
    Ok(bytes)
}
