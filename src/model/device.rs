//! What computes: a graphics processor, or the processor.

use burn::tensor::Device;
use serde::{Deserialize, Serialize};

/// What a user asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DeviceChoice {
    /// A graphics processor where there is one, else the processor.
    Auto,
    /// Whatever adapter wgpu prefers, even one that is software.
    Wgpu,
    /// The processor.
    Cpu,
}

/// What is used, and why.
#[derive(Debug, Clone)]
pub struct Selected {
    /// The device, without automatic differentiation.
    pub device: Device,
    /// What it is, for records: `cpu, 8 threads` or the name, backend and driver of the adapter.
    pub name: String,
    /// Why a graphics processor was not used although one was wished for.
    pub note: Option<String>,
}

/// An adapter that wgpu can use.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Adapter {
    /// Name, backend and driver.
    pub name: String,
    /// Whether it is a program on the processor rather than a graphics processor.
    pub is_software: bool,
}

/// Why there is no device.
#[derive(Debug, thiserror::Error)]
#[error("use wgpu: {0}; use --device cpu instead")]
pub struct DeviceError(String);

/// The processor, with its number of threads.
#[must_use]
pub fn cpu() -> Selected {
    Selected {
        device: Device::flex(),
        name: format!("cpu, {} threads", rayon::current_num_threads()),
        note: None,
    }
}

/// The device a user asks for; `auto` never fails.
///
/// The runtime of wgpu begins once in a process, so a second call within it repeats the answer of the first.
///
/// # Errors
/// [`DeviceError`] when wgpu was asked for by name and there is no adapter, or this program was built without it.
pub fn select(choice: DeviceChoice) -> Result<Selected, DeviceError> {
    match choice {
        DeviceChoice::Cpu => Ok(cpu()),
        DeviceChoice::Wgpu => wgpu()
            .map(|(device, adapter)| Selected { device, name: adapter.name, note: None })
            .map_err(DeviceError),
        DeviceChoice::Auto => {
            let reason = match wgpu() {
                Ok((device, adapter)) if !adapter.is_software => {
                    return Ok(Selected { device, name: adapter.name, note: None });
                }
                Ok((_, adapter)) => format!("the only adapter, {}, is software", adapter.name),
                Err(reason) => reason,
            };
            let note = Some(format!("no graphics processor ({reason}); using the processor"));
            Ok(Selected { note, ..cpu() })
        }
    }
}

#[cfg(feature = "wgpu")]
fn wgpu() -> Result<(Device, Adapter), String> {
    use std::sync::OnceLock;

    static FIRST: OnceLock<Result<(Device, Adapter), String>> = OnceLock::new();
    FIRST
        .get_or_init(|| {
            let (device, setup) =
                Device::wgpu_options().init_with_setup().map_err(|error| error.to_string())?;
            let info = setup.adapter.get_info();
            let is_software = info.device_type == burn::tensor::wgpu::wgpu::DeviceType::Cpu;
            let driver = format!("{} {}", info.driver, info.driver_info);
            let name = format!("{} ({:?}, {})", info.name, info.backend, driver.trim());
            Ok((device, Adapter { name, is_software }))
        })
        .clone()
}

#[cfg(not(feature = "wgpu"))]
fn wgpu() -> Result<(Device, Adapter), String> {
    Err("this program was built without the feature wgpu".to_owned())
}

/// The adapter wgpu prefers.
///
/// # Errors
/// Why there is none.
pub fn adapter() -> Result<Adapter, String> {
    wgpu().map(|(_, adapter)| adapter)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn auto_always_finds_something_and_says_what() {
        let selected = select(DeviceChoice::Auto).unwrap();
        assert!(!selected.name.is_empty());
        // Fallen back exactly when there is a note.
        assert_eq!(selected.note.is_some(), selected.name.starts_with("cpu"));
        assert!(select(DeviceChoice::Cpu).unwrap().name.contains("threads"));
    }
}
