//! Dependencies between the modules of a crate, from its sources.
//!
//! Siblings, the modules of one folder, are compared: they must not use each other in a circle, themselves or by
//! modules below them. Between a module and its parent nothing is tested: children may use the types of their parent.
//! An item used through a re-export of the parent counts as used from its definition. Paths in macros and attributes
//! count, those in strings do not. Test modules are skipped.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use syn::buffer::{Cursor, TokenBuffer};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, ItemMod, ItemUse, Macro, MetaList, UseTree};

/// The path of a module from the root of its crate.
type Module = Vec<String>;

/// Contents of a module's file.
#[derive(Default)]
struct Content {
    /// Items defined in the module.
    items: BTreeSet<String>,
    /// Imported names, with their paths.
    imports: BTreeMap<String, Vec<String>>,
    /// Paths of glob imports.
    globs: Vec<Vec<String>>,
    /// All paths in the module.
    paths: Vec<Vec<String>>,
    /// Modules declared in it that have files of their own.
    children: Vec<String>,
}

/// Circular dependencies of a crate: for each folder, the modules that use one another.
pub fn circles(sources: &Path) -> Vec<String> {
    let mut modules = BTreeMap::new();
    read(&sources.join("lib.rs"), sources, Vec::new(), &mut modules);
    let mut arrows: BTreeMap<Module, BTreeMap<String, BTreeSet<String>>> = BTreeMap::new();
    for (module, content) in &modules {
        for used in content.paths.iter().filter_map(|path| resolve(&modules, module, path, 0)) {
            let shared = module.iter().zip(&used).take_while(|(a, b)| a == b).count();
            if let (Some(from), Some(to)) = (module.get(shared), used.get(shared)) {
                let folder = arrows.entry(module[..shared].to_vec()).or_default();
                folder.entry(from.clone()).or_default().insert(to.clone());
            }
        }
    }
    let circle_of = |(folder, uses): (&Module, &BTreeMap<String, BTreeSet<String>>)| {
        let circle: Vec<&str> = uses.keys().filter(|from| reaches(uses, from)).map(String::as_str).collect();
        (!circle.is_empty()).then(|| format!("{}::{{{}}}", folder.join("::"), circle.join(", ")))
    };
    arrows.iter().filter_map(circle_of).collect()
}

/// Whether arrows lead from `start` back to it.
fn reaches(uses: &BTreeMap<String, BTreeSet<String>>, start: &str) -> bool {
    let (mut seen, mut open) = (BTreeSet::new(), vec![start]);
    while let Some(from) = open.pop() {
        for to in uses.get(from).into_iter().flatten() {
            if to == start {
                return true;
            }
            if seen.insert(to) {
                open.push(to);
            }
        }
    }
    false
}

/// Reads the file of `module` and those of its children; theirs are in `folder`.
fn read(file: &Path, folder: &Path, module: Module, modules: &mut BTreeMap<Module, Content>) {
    let text = fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let parsed = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let mut content = Content::default();
    content.visit_file(&parsed);
    content.paths.extend(content.imports.values().chain(&content.globs).cloned());
    for child in &content.children {
        let inside = folder.join(child);
        let own = [inside.join("mod.rs"), inside.with_extension("rs")].into_iter().find(|file| file.exists());
        let own = own.unwrap_or_else(|| panic!("{}: no file of module {child}", file.display()));
        read(&own, &inside, [&module[..], std::slice::from_ref(child)].concat(), modules);
    }
    modules.insert(module, content);
}

/// Module that defines what `path` in `module` names; `None` for other crates.
fn resolve(
    modules: &BTreeMap<Module, Content>,
    module: &[String],
    path: &[String],
    depth: usize,
) -> Option<Module> {
    let (mut here, mut rest) = match path.first()?.as_str() {
        "crate" => (Vec::new(), &path[1..]),
        "self" => (module.to_vec(), &path[1..]),
        "super" => {
            let ups = path.iter().take_while(|name| *name == "super").count();
            (module[..module.len().checked_sub(ups)?].to_vec(), &path[ups..])
        }
        first => {
            let content = &modules[module];
            let known = content.children.iter().any(|child| child == first);
            if !known && (depth > 0 || !content.imports.contains_key(first)) {
                return None;
            }
            (module.to_vec(), path)
        }
    };
    while let Some(name) = rest.first() {
        let content = modules.get(&here)?;
        if content.children.contains(name) {
            here.push(name.clone());
            rest = &rest[1..];
        } else if let Some(import) = content.imports.get(name).filter(|_| depth < 8) {
            return resolve(modules, &here, &[&import[..], &rest[1..]].concat(), depth + 1);
        } else {
            let glob = |glob: &Vec<String>| {
                let found = resolve(modules, &here, glob, depth + 1)?;
                modules[&found].items.contains(name).then_some(found)
            };
            let of_globs = content.globs.iter().filter(|_| !content.items.contains(name)).find_map(glob);
            return Some(of_globs.unwrap_or(here));
        }
    }
    Some(here)
}

impl Content {
    fn import(&mut self, tree: &UseTree, before: &[String]) {
        let with = |name: String| [before, &[name]].concat();
        match tree {
            UseTree::Path(path) => self.import(&path.tree, &with(path.ident.to_string())),
            UseTree::Group(group) => group.items.iter().for_each(|tree| self.import(tree, before)),
            UseTree::Glob(_) => self.globs.push(before.to_vec()),
            UseTree::Name(name) if name.ident == "self" => {
                self.imports.insert(before.last().cloned().unwrap_or_default(), before.to_vec());
            }
            UseTree::Name(name) => {
                self.imports.insert(name.ident.to_string(), with(name.ident.to_string()));
            }
            UseTree::Rename(rename) => {
                self.imports.insert(rename.rename.to_string(), with(rename.ident.to_string()));
            }
        }
    }
}

/// Paths of more than one name among the tokens of a macro or an attribute, also in their brackets.
fn paths_of_tokens(mut at: Cursor) -> Vec<Vec<String>> {
    let (mut paths, mut path) = (Vec::new(), Vec::<String>::new());
    while !at.eof() {
        if let Some((name, after)) = at.ident() {
            path.push(name.to_string());
            at = after;
            if let Some(behind) = double_colon(at).filter(|behind| behind.ident().is_some()) {
                at = behind;
                continue;
            }
        } else if let Some((inside, _, _, after)) = at.any_group() {
            paths.extend(paths_of_tokens(inside));
            at = after;
        } else if let Some((_, after)) = at.token_tree() {
            at = after;
        }
        paths.extend(Some(std::mem::take(&mut path)).filter(|path| path.len() > 1));
    }
    paths
}

/// The place behind `::`, if it is next.
fn double_colon(at: Cursor) -> Option<Cursor> {
    let (first, at) = at.punct()?;
    let (second, at) = at.punct()?;
    (first.as_char() == ':' && second.as_char() == ':').then_some(at)
}

fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg")
            && attribute.parse_args::<syn::Path>().is_ok_and(|path| path.is_ident("test"))
    })
}

impl Visit<'_> for Content {
    fn visit_item(&mut self, item: &Item) {
        let (name, attributes) = match item {
            Item::Const(item) => (Some(&item.ident), &item.attrs),
            Item::Enum(item) => (Some(&item.ident), &item.attrs),
            Item::Fn(item) => (Some(&item.sig.ident), &item.attrs),
            Item::Static(item) => (Some(&item.ident), &item.attrs),
            Item::Struct(item) => (Some(&item.ident), &item.attrs),
            Item::Trait(item) => (Some(&item.ident), &item.attrs),
            Item::Type(item) => (Some(&item.ident), &item.attrs),
            Item::Impl(item) => (None, &item.attrs),
            Item::Mod(item) => (None, &item.attrs),
            Item::Use(item) => (None, &item.attrs),
            _ => return visit::visit_item(self, item),
        };
        if !is_test(attributes) {
            self.items.extend(name.map(ToString::to_string));
            visit::visit_item(self, item);
        }
    }

    fn visit_item_mod(&mut self, item: &ItemMod) {
        match item.content {
            Some(_) => visit::visit_item_mod(self, item),
            None => self.children.push(item.ident.to_string()),
        }
    }

    fn visit_item_use(&mut self, item: &ItemUse) {
        self.import(&item.tree, &[]);
    }

    fn visit_path(&mut self, path: &syn::Path) {
        if path.segments.len() > 1 {
            self.paths.push(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, called: &Macro) {
        self.paths.extend(paths_of_tokens(TokenBuffer::new2(called.tokens.clone()).begin()));
        visit::visit_macro(self, called);
    }

    fn visit_meta_list(&mut self, list: &MetaList) {
        self.paths.extend(paths_of_tokens(TokenBuffer::new2(list.tokens.clone()).begin()));
        visit::visit_meta_list(self, list);
    }
}
