//! The directives of a file, and the state that they change.

use std::collections::HashMap;
use std::path::PathBuf;
use std::rc::Rc;

use treelet_model::{Model, Object, Part, Placement, Sky};

use crate::error::{DAMAGED, Fault, Place, Result, quote};
use crate::options::HARMLESS_BYTES;
use crate::source::Source;

use super::camera::Film;
use super::directives::{shown, step_over, string};
use super::notes::Notes;
use super::params::{Param, Params};
use super::textures::Textures;
use super::tokens::{Token, Tokens};
use super::transform::{self, IDENTITY, Rows};

/// What a pair of `AttributeBegin` and `AttributeEnd` saves.
#[derive(Clone, Debug)]
pub(super) struct State {
    /// Takes the current coordinates to the world; before `WorldBegin` to the camera.
    pub(super) ctm: Rows,
    /// Index of the material; `None` for surfaces that nothing meets.
    pub(super) material: Option<usize>,
    /// What shapes emit, and whether on both sides.
    pub(super) emission: Option<([f32; 3], bool)>,
    /// Whether surfaces are turned over.
    pub(super) is_reversed: bool,
    /// Parameters that directives of a kind have unless they say otherwise.
    defaults: Rc<Vec<(Rc<str>, Rc<Param>)>>,
}

/// What was read so far.
pub(super) struct Scene<'s, 'a> {
    pub(super) main: &'s Source<'a>,
    pub(super) model: Model,
    pub(super) state: State,
    stack: Vec<(Block, State)>,
    pub(super) spaces: HashMap<Vec<u8>, Rows>,
    named_materials: HashMap<String, Option<usize>>,
    pub(super) textures: Textures,
    objects: HashMap<Vec<u8>, usize>,
    /// The object that is being defined.
    pub(super) open: Option<usize>,
    /// Shapes outside objects.
    pub(super) world: Vec<Part>,
    /// Meshes of other files, each read once.
    pub(super) files: HashMap<PathBuf, Rc<Part>>,
    /// Materials with the emission or opacity of a shape.
    pub(super) variants: HashMap<String, usize>,
    /// Objects of one unit sphere each, by material and side.
    pub(super) spheres: HashMap<(usize, bool), usize>,
    pub(super) film: Film,
    pub(super) notes: Notes,
    /// Bytes of included files, each time they are read.
    included: u64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Block {
    Attribute,
    Transform,
    Object,
}

/// Files that include files, so deep.
const DEPTH_MAX: usize = 32;
/// What an inclusion counts at least, in bytes.
const INCLUDE_MIN: u64 = 4096;

impl<'s, 'a> Scene<'s, 'a> {
    pub(super) fn new(main: &'s Source<'a>) -> Self {
        let mut model = Model::default();
        model.materials.push(treelet_model::Material::diffuse([0.5; 3]));
        let state = State {
            ctm: IDENTITY,
            material: Some(0),
            emission: None,
            is_reversed: false,
            defaults: Rc::default(),
        };
        Self {
            main,
            model,
            state,
            stack: Vec::new(),
            spaces: HashMap::new(),
            named_materials: HashMap::new(),
            textures: Textures::default(),
            objects: HashMap::new(),
            open: None,
            world: Vec::new(),
            files: HashMap::new(),
            variants: HashMap::new(),
            spheres: HashMap::new(),
            film: Film::default(),
            notes: Notes::default(),
            included: 0,
        }
    }

    /// Reads all directives of a file.
    pub(super) fn run(&mut self, file: &Source<'_>, depth: usize) -> Result<()> {
        let mut tokens = Tokens::new(file.bytes);
        loop {
            let line = tokens.line;
            let place = Place::Line(line);
            file.check_cancelled()?;
            match tokens.next().map_err(|fault| file.error(place.clone(), fault))? {
                None => return Ok(()),
                Some(Token::Word(word)) => {
                    self.directive(file, (word, line), &mut tokens, depth)?
                }
                Some(token) => {
                    let found = format!("{} where a directive should stand", shown(token));
                    return Err(file.broken(place, found, DAMAGED));
                }
            }
        }
    }

    /// Takes one directive, whose first word is `word`, on `line`.
    fn directive(
        &mut self,
        file: &Source<'_>,
        (word, line): (&[u8], u64),
        tokens: &mut Tokens<'_>,
        depth: usize,
    ) -> Result<()> {
        if self.transform_directive(file, word, line, tokens)? {
            return Ok(());
        }
        match word {
            b"WorldBegin" => {
                self.place_camera();
                self.state.ctm = IDENTITY;
                self.spaces.insert(b"world".to_vec(), IDENTITY);
            }
            b"AttributeBegin" => self.begin(Block::Attribute)?,
            b"TransformBegin" => self.begin(Block::Transform)?,
            b"AttributeEnd" => self.end(file, Block::Attribute, line)?,
            b"TransformEnd" => self.end(file, Block::Transform, line)?,
            b"ObjectBegin" => {
                let name = string(file, tokens)?.to_vec();
                self.begin_object(file, name, line)?;
            }
            b"ObjectEnd" => self.end(file, Block::Object, line)?,
            b"ObjectInstance" => {
                let name = string(file, tokens)?;
                self.instance(file, name, line)?;
            }
            b"ReverseOrientation" => self.state.is_reversed ^= true,
            b"Include" | b"Import" => {
                let name = string(file, tokens)?;
                self.include(file, word, name, line, depth)?;
            }
            b"NamedMaterial" => {
                let name = String::from_utf8_lossy(string(file, tokens)?).into_owned();
                match self.named_materials.get(&name) {
                    Some(&material) => self.state.material = material,
                    None => self.notes.add(format!("The material {name:?} is not defined")),
                }
            }
            b"WorldEnd" => {}
            b"Texture" => {
                let name = String::from_utf8_lossy(string(file, tokens)?).into_owned();
                let value = string(file, tokens)?;
                let is_float = value == b"float";
                let class = String::from_utf8_lossy(string(file, tokens)?).into_owned();
                let params = self.params(file, line, tokens, "texture")?;
                self.texture(file, name, is_float, &class, &params)?;
            }
            _ => return self.described(file, word, line, tokens),
        }
        Ok(())
    }

    /// Directives of a kind and parameters.
    fn described(
        &mut self,
        file: &Source<'_>,
        word: &[u8],
        line: u64,
        tokens: &mut Tokens<'_>,
    ) -> Result<()> {
        const QUIET: [&[u8]; 6] =
            [b"Sampler", b"Integrator", b"PixelFilter", b"Accelerator", b"ColorSpace", b"Option"];
        let kind = |tokens: &mut Tokens<'_>| -> Result<String> {
            Ok(String::from_utf8_lossy(string(file, tokens)?).into_owned())
        };
        match word {
            b"Shape" => {
                let kind = kind(tokens)?;
                let params = self.params(file, line, tokens, "shape")?;
                self.shape(file, &kind, &params)
            }
            b"Material" => {
                let kind = kind(tokens)?;
                let params = self.params(file, line, tokens, "material")?;
                self.state.material = self.add_material(file, "", &kind, &params)?;
                Ok(())
            }
            b"MakeNamedMaterial" => {
                let name = kind(tokens)?;
                let params = self.params(file, line, tokens, "material")?;
                let kind = params.string("type").unwrap_or("diffuse").to_owned();
                let material = self.add_material(file, &name, &kind, &params)?;
                self.named_materials.insert(name, material);
                Ok(())
            }
            b"AreaLightSource" => {
                let kind = kind(tokens)?;
                let params = self.params(file, line, tokens, "light")?;
                self.area_light(&kind, &params);
                Ok(())
            }
            b"LightSource" => {
                let kind = kind(tokens)?;
                let params = self.params(file, line, tokens, "light")?;
                self.light(file, &kind, &params)
            }
            b"Camera" => {
                let kind = kind(tokens)?;
                let params = self.params(file, line, tokens, "")?;
                let world_from_camera = transform::inverse(&self.state.ctm);
                if let Some(world_from_camera) = world_from_camera {
                    self.spaces.insert(b"camera".to_vec(), world_from_camera);
                }
                self.camera(&kind, &params);
                Ok(())
            }
            b"Film" => {
                kind(tokens)?;
                let params = self.params(file, line, tokens, "")?;
                self.film.size(&params);
                Ok(())
            }
            b"Attribute" => {
                let target = kind(tokens)?;
                let params = Params::read(file, tokens)?;
                let target: Rc<str> = target.into();
                // The list may be shared with outer blocks, and then becomes one of its own.
                let bytes = size_of::<(Rc<str>, Rc<Param>)>() * self.state.defaults.len();
                file.whole(file.budget.spend(bytes as u64, "attributes"))?;
                let defaults = Rc::make_mut(&mut self.state.defaults);
                for param in params.list {
                    file.push(defaults, (Rc::clone(&target), param), "attributes")?;
                }
                Ok(())
            }
            b"MakeNamedMedium" | b"MediumInterface" => {
                self.notes.add("Media are not read");
                step_over(file, tokens)
            }
            b"ActiveTransform" => {
                tokens.next().map_err(|fault| file.error(Place::Line(tokens.line), fault))?;
                self.notes.add("Motion is not read; shapes stand where they are at first");
                Ok(())
            }
            word => {
                if !QUIET.contains(&word) {
                    let told = format!("The pbrt directive {} is not known; left out", quote(word));
                    self.notes.add(told);
                }
                step_over(file, tokens)
            }
        }
    }

    /// The index of a material by its name.
    pub(super) fn named_material(&self, name: &str) -> Option<usize> {
        self.named_materials.get(name).copied().flatten()
    }

    fn begin(&mut self, block: Block) -> Result<()> {
        self.main.push(&mut self.stack, (block, self.state.clone()), "blocks")
    }

    fn end(&mut self, file: &Source<'_>, block: Block, line: u64) -> Result<()> {
        match self.stack.pop() {
            Some((open, state)) if open == block => {
                match block {
                    Block::Transform => self.state.ctm = state.ctm,
                    Block::Attribute => self.state = state,
                    Block::Object => {
                        self.state = state;
                        self.open = None;
                    }
                }
                Ok(())
            }
            _ => {
                let found =
                    format!("ends a block of type {block:?} that is not the last one begun");
                Err(file.broken(Place::Line(line), found, DAMAGED))
            }
        }
    }

    fn begin_object(&mut self, file: &Source<'_>, name: Vec<u8>, line: u64) -> Result<()> {
        if self.open.is_some() {
            let found = "begins an object inside an object";
            return Err(file.broken(Place::Line(line), found, "end the first one before"));
        }
        self.begin(Block::Object)?;
        let object = self.model.objects.len();
        let shown = String::from_utf8_lossy(&name).into_owned();
        let made = Object { name: shown, parts: Vec::new() };
        file.push(&mut self.model.objects, made, "objects")?;
        self.objects.insert(name, object);
        self.open = Some(object);
        Ok(())
    }

    fn instance(&mut self, file: &Source<'_>, name: &[u8], line: u64) -> Result<()> {
        if self.open.is_some() {
            let found = "places an object inside an object";
            return Err(file.broken(Place::Line(line), found, "place it outside"));
        }
        let Some(&object) = self.objects.get(name) else {
            self.notes.add(format!("The object {} is not defined", quote(name)));
            return Ok(());
        };
        let world_from_object = transform::rounded(&self.state.ctm);
        let placement = Placement { object, world_from_object };
        file.push(&mut self.model.placements, placement, "placements")
    }

    /// Reads another file in this place.
    fn include(
        &mut self,
        file: &Source<'_>,
        word: &[u8],
        name: &[u8],
        line: u64,
        depth: usize,
    ) -> Result<()> {
        let place = Place::Line(line);
        if depth >= DEPTH_MAX {
            let found = format!("files include each other {DEPTH_MAX} deep");
            return Err(file.broken(place, found, "look for a file that includes itself"));
        }
        // Paths are told from the first file's folder, as in pbrt.
        let side = self.main.find(&place, &String::from_utf8_lossy(name))?;
        let bytes = self.main.read_side(&side)?;
        self.included = self.included.saturating_add(INCLUDE_MIN.max(bytes.len() as u64));
        if self.included > HARMLESS_BYTES.max(8 * self.main.bytes.len() as u64) + INCLUDED_MAX {
            let what = "included files";
            return Err(file.error(place, Fault::Repeats { what, ratio: 8 }));
        }
        let is_import = word == b"Import";
        let before = is_import.then(|| self.state.clone());
        let source = self.main.beside(&side, &bytes);
        self.run(&source, depth + 1)?;
        if let Some(before) = before {
            self.state = before;
        }
        Ok(())
    }

    /// The parameters of a directive, with the defaults of its kind.
    fn params(
        &self,
        file: &Source<'_>,
        line: u64,
        tokens: &mut Tokens<'_>,
        target: &str,
    ) -> Result<Params> {
        let mut params = Params { line, ..Params::read(file, tokens)? };
        for (_, param) in self.state.defaults.iter().filter(|(name, _)| **name == *target) {
            params.list.push(Rc::clone(param));
        }
        Ok(params)
    }

    /// The model of all that was read.
    pub(super) fn finish(mut self) -> Result<Model> {
        if let Some((block, _)) = self.stack.last() {
            self.notes.add(format!("A block of type {block:?} is not ended"));
        }
        self.place_camera();
        if !self.world.is_empty() {
            let object = self.model.objects.len();
            let name = "world".to_owned();
            self.model.objects.push(Object { name, parts: std::mem::take(&mut self.world) });
            let placement = Placement { object, world_from_object: Default::default() };
            self.main.push(&mut self.model.placements, placement, "placements")?;
        }
        // A scene that brings its own light has no other.
        let is_lit = !self.model.lights.is_empty()
            || self.model.materials.iter().any(treelet_model::Material::is_emissive);
        let has_sky = self.model.sky.is_some() || self.model.environment.is_some();
        if is_lit && !has_sky {
            self.model.sky = Some(Sky::uniform([0.0; 3]));
        }
        self.model.up = self.film.up_axis();
        self.model.warnings = self.notes.warnings();
        Ok(self.model)
    }
}

/// Included bytes beyond the harmless, whatever the size of the first file: scenes of a gigabyte
/// have a first file of a few lines.
const INCLUDED_MAX: u64 = 16 << 30;
