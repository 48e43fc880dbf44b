//! The definitions of the wire contract as they stand in `ipc/src`, with their comments.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use syn::{Attribute, Expr, Fields, Item, Lit, Meta, Type};

/// A `repr(C)` struct.
#[derive(Debug)]
pub(crate) struct Struct {
    pub(crate) fields: Vec<Field>,
    pub(crate) comment: String,
    /// The name by which iceoryx2 compares types, where the struct is one of its own.
    pub(crate) type_name: Option<String>,
}

#[derive(Debug)]
pub(crate) struct Field {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    pub(crate) comment: String,
}

/// The type of a field.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Kind {
    /// `u8`, `u32`, `u64`, `f32`, `f64`, or a struct of the contract.
    Named(String),
    Array(Box<Kind>, usize),
}

/// An enum whose numbers travel.
#[derive(Debug)]
pub(crate) struct Enum {
    pub(crate) variants: Vec<Variant>,
}

#[derive(Debug)]
pub(crate) struct Variant {
    pub(crate) name: String,
    pub(crate) number: u32,
    pub(crate) comment: String,
}

/// All definitions of `ipc/src` by their names.
#[derive(Debug, Default)]
pub(crate) struct Source {
    pub(crate) structs: BTreeMap<String, Struct>,
    pub(crate) enums: BTreeMap<String, Enum>,
    /// Public constants, and their comments.
    pub(crate) constants: BTreeMap<String, String>,
    aliases: BTreeMap<String, Kind>,
}

/// The files of a folder and of those in it.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

impl Source {
    /// Reads all modules but those whose constants do not travel.
    pub(crate) fn read() -> Self {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let mut source = Self::default();
        for path in files(&folder) {
            let file = syn::parse_file(&std::fs::read_to_string(&path).unwrap()).unwrap();
            for item in file.items {
                source.add(item);
            }
        }
        let aliases = std::mem::take(&mut source.aliases);
        for field in source.structs.values_mut().flat_map(|s| &mut s.fields) {
            if let Kind::Named(name) = &field.kind
                && let Some(kind) = aliases.get(name)
            {
                field.kind = kind.clone();
            }
        }
        source
    }

    fn add(&mut self, item: Item) {
        match item {
            Item::Struct(item) if has_repr(&item.attrs, "C") => {
                let Fields::Named(fields) = item.fields else { panic!("{} has no names", item.ident) };
                let fields = fields.named.into_iter().map(|field| Field {
                    name: field.ident.unwrap().to_string(),
                    kind: kind(&field.ty),
                    comment: comment(&field.attrs),
                });
                let found = Struct {
                    fields: fields.collect(),
                    comment: comment(&item.attrs),
                    type_name: type_name(&item.attrs),
                };
                self.structs.insert(item.ident.to_string(), found);
            }
            Item::Enum(item) if has_repr(&item.attrs, "u32") => {
                let variants = item.variants.into_iter().map(|variant| {
                    let Some((_, number)) = variant.discriminant else {
                        panic!("{} has no number", variant.ident)
                    };
                    Variant {
                        name: variant.ident.to_string(),
                        number: integer(&number),
                        comment: comment(&variant.attrs),
                    }
                });
                self.enums.insert(item.ident.to_string(), Enum { variants: variants.collect() });
            }
            Item::Const(item) if matches!(item.vis, syn::Visibility::Public(_)) => {
                self.constants.insert(item.ident.to_string(), comment(&item.attrs));
            }
            Item::Type(item) if matches!(*item.ty, Type::Array(_)) => {
                self.aliases.insert(item.ident.to_string(), kind(&item.ty));
            }
            _ => {}
        }
    }
}

fn kind(found: &Type) -> Kind {
    match found {
        Type::Path(path) => Kind::Named(path.path.segments.last().unwrap().ident.to_string()),
        Type::Array(array) => Kind::Array(Box::new(kind(&array.elem)), integer(&array.len) as usize),
        _ => panic!("a type is neither a name nor an array"),
    }
}

fn integer(expression: &Expr) -> u32 {
    match expression {
        Expr::Lit(literal) => match &literal.lit {
            Lit::Int(number) => number.base10_parse().unwrap(),
            _ => panic!("a number is no integer"),
        },
        _ => panic!("a number is no literal"),
    }
}

fn has_repr(attributes: &[Attribute], name: &str) -> bool {
    let mut found = false;
    for attribute in attributes.iter().filter(|a| a.path().is_ident("repr")) {
        let mut look = |meta: syn::meta::ParseNestedMeta<'_>| {
            found |= meta.path.is_ident(name);
            Ok(())
        };
        attribute.parse_nested_meta(&mut look).unwrap();
    }
    found
}

fn type_name(attributes: &[Attribute]) -> Option<String> {
    let attribute = attributes.iter().find(|a| a.path().is_ident("type_name"))?;
    Some(attribute.parse_args::<syn::LitStr>().unwrap().value())
}

/// The comment in one line of Markdown: no links of rustdoc, and largest numbers written out.
fn comment(attributes: &[Attribute]) -> String {
    let mut lines = Vec::new();
    for attribute in attributes {
        if let Meta::NameValue(pair) = &attribute.meta
            && pair.path.is_ident("doc")
            && let Expr::Lit(literal) = &pair.value
            && let Lit::Str(text) = &literal.lit
        {
            lines.push(text.value().trim().to_owned());
        }
    }
    let text = lines.join(" ").replace("`u64::MAX`", "2⁶⁴−1").replace("`u32::MAX`", "2³²−1");
    without_links(&text).replace('|', "\\|")
}

/// [`a::B`] and [`B`](a::B) become `B`.
fn without_links(text: &str) -> String {
    let Some((before, rest)) = text.split_once("[`") else { return text.to_owned() };
    let (name, rest) = rest.split_once("`]").unwrap();
    let rest = match rest.strip_prefix('(') {
        Some(target) => target.split_once(')').unwrap().1,
        None => rest,
    };
    let name = name.rsplit("::").next().unwrap();
    format!("{before}`{name}`{}", without_links(rest))
}
