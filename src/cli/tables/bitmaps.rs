//! Figures as PNG, in programs that can draw them.

use std::path::Path;

/// What draws figures as PNG where that is asked for.
pub(super) struct Bitmaps {
    #[cfg(feature = "png")]
    bitmaps: Option<crate::report::Bitmaps>,
}

impl Bitmaps {
    /// Refuses what this program or machine cannot do before anything is computed.
    #[cfg(feature = "png")]
    pub fn new(asked: bool) -> anyhow::Result<Self> {
        Ok(Self { bitmaps: asked.then(crate::report::Bitmaps::new).transpose()? })
    }

    /// Refuses what this program cannot do before anything is computed.
    #[cfg(not(feature = "png"))]
    pub fn new(asked: bool) -> anyhow::Result<Self> {
        anyhow::ensure!(
            !asked,
            "use --png: this program was built without it; build with `--features png`, or take the SVG files"
        );
        Ok(Self {})
    }

    /// Writes a figure as PNG beside the file of its SVG, if that was asked for.
    #[cfg_attr(
        not(feature = "png"),
        expect(clippy::unused_self, unused_variables, reason = "as with the feature")
    )]
    pub fn write(&self, path: &Path, svg: &str) -> anyhow::Result<()> {
        let path = path.with_extension("png");
        #[cfg(feature = "png")]
        if let Some(bitmaps) = &self.bitmaps {
            crate::manifest::write_file(&path, &bitmaps.png(svg)?)?;
            return Ok(());
        }
        // One of earlier numbers must not stay beside the new picture.
        if path.exists() {
            std::fs::remove_file(&path)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_drawn_unless_asked() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("figure.svg");
        let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"4\" height=\"4\"/>";
        Bitmaps::new(false).unwrap().write(&path, svg).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[cfg(not(feature = "png"))]
    #[test]
    fn a_program_that_cannot_draw_says_how_to_get_one_that_can() {
        let error = Bitmaps::new(true).err().unwrap().to_string();
        assert!(error.contains("--features png"), "{error}");
    }
}
