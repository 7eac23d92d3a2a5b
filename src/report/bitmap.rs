//! Pictures as PNG.
//!
//! Only with the feature `png`: the renderer (resvg) takes thirty crates and 41 seconds of processor time to build. Its letters are
//! those of the fonts of the machine, so two machines may give two files; the SVG beside it is the same everywhere.

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::fontdb::{Database, Family, Query};
use resvg::usvg::{Options, Tree};

/// Pixels for each unit of the picture, so that letters are sharp on fine screens and in print.
const SCALE: f32 = 2.0;

/// Fonts without serifs that machines tend to have, the most usual first.
const SANS_SERIF: [&str; 6] =
    ["Arial", "Helvetica", "DejaVu Sans", "Liberation Sans", "Noto Sans", "Segoe UI"];

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BitmapError {
    /// Not one font on the machine.
    #[error(
        "draw the picture: this machine has no fonts, and it has letters; install one, for example fonts-dejavu-core"
    )]
    NoFonts,
    /// Text that is no SVG.
    #[error("draw the picture: {0}")]
    Svg(#[from] resvg::usvg::Error),
    /// A size that no bitmap has.
    #[error("draw the picture: {width} x {height} pixels are no size of a bitmap")]
    Size {
        /// Pixels across.
        width: f32,
        /// Pixels down.
        height: f32,
    },
    /// The bitmap cannot be written as PNG.
    #[error("draw the picture: {0}")]
    Encode(String),
}

/// Draws SVG files.
#[derive(Debug)]
pub struct Bitmaps {
    options: Options<'static>,
}

impl Bitmaps {
    /// Looks for the fonts of the machine.
    ///
    /// # Errors
    /// [`BitmapError::NoFonts`].
    pub fn new() -> Result<Self, BitmapError> {
        let mut options = Options::default();
        let fonts = options.fontdb_mut();
        fonts.load_system_fonts();
        let family = sans_serif(fonts).ok_or(BitmapError::NoFonts)?;
        fonts.set_sans_serif_family(&family);
        options.font_family = family;
        Ok(Self { options })
    }

    /// A picture as PNG, two pixels for each of its units.
    ///
    /// # Errors
    /// [`BitmapError`] for text that is no SVG, or one without a size.
    pub fn png(&self, svg: &str) -> Result<Vec<u8>, BitmapError> {
        let tree = Tree::from_str(svg, &self.options)?;
        let (width, height) = (tree.size().width() * SCALE, tree.size().height() * SCALE);
        // A size that does not fit becomes 0 or the largest number, which no bitmap has.
        let bitmap = Pixmap::new(width.ceil() as u32, height.ceil() as u32);
        let mut bitmap = bitmap.ok_or(BitmapError::Size { width, height })?;
        resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut bitmap.as_mut());
        bitmap.encode_png().map_err(|error| BitmapError::Encode(error.to_string()))
    }
}

/// The font that is used where a picture asks for one without serifs.
fn sans_serif(fonts: &Database) -> Option<String> {
    let is_there = |name: &&&str| {
        let query = Query { families: &[Family::Name(name)], ..Query::default() };
        fonts.query(&query).is_some()
    };
    match SANS_SERIF.iter().find(is_there) {
        Some(name) => Some((*name).to_owned()),
        None => fonts.faces().next()?.families.first().map(|(name, _)| name.clone()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_and_letters_are_drawn() {
        let bitmaps = match Bitmaps::new() {
            Ok(bitmaps) => bitmaps,
            Err(error) => return println!("skipped: {error}"),
        };
        let svg = |letters: &str| {
            format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"60\" height=\"20\" font-family=\"sans-serif\" font-size=\"12\">\
                 <rect width=\"100%\" height=\"100%\" fill=\"white\"/><rect width=\"10\" height=\"20\" fill=\"#ff0000\"/>\
                 <text x=\"15\" y=\"15\">{letters}</text></svg>"
            )
        };
        let bitmap = |letters: &str| Pixmap::decode_png(&bitmaps.png(&svg(letters)).unwrap()).unwrap();
        let drawn = bitmap("walk");
        assert_eq!((drawn.width(), drawn.height()), (120, 40));
        let color = |x, y| drawn.pixel(x, y).map(|pixel| (pixel.red(), pixel.green(), pixel.blue()));
        assert_eq!((color(19, 20), color(21, 39)), (Some((255, 0, 0)), Some((255, 255, 255))));
        let dark = |bitmap: &Pixmap| bitmap.pixels().iter().filter(|pixel| pixel.red() < 100).count();
        assert_eq!(dark(&bitmap("")), 0);
        assert!(dark(&drawn) > 50);
    }

    #[test]
    fn what_is_no_picture_is_refused() {
        let Ok(bitmaps) = Bitmaps::new() else { return println!("skipped: no fonts") };
        assert!(matches!(bitmaps.png("<svg"), Err(BitmapError::Svg(_))));
    }
}
