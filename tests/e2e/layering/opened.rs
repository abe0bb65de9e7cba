//! Places in product code that open files, from its sources. Items of tests are skipped, wherever they are.

use syn::visit::{self, Visit};
use syn::{File, ImplItem, Item, Macro, Path, UseTree};

use super::packets::{attributes, is_test};

/// What the code of a file does to open files.
pub fn opened(text: &str) -> Vec<String> {
    let parsed: File = syn::parse_file(text).expect("a source file");
    let mut found = Found::default();
    found.visit_file(&parsed);
    found.what
}

#[derive(Default)]
struct Found {
    what: Vec<String>,
}

impl Found {
    /// A path in code or an import, by its names.
    fn named(&mut self, names: &[String]) {
        let opens = |pair: &[String]| {
            pair[0] == "fs" && pair[1].starts_with("read") || pair[0] == "File" && pair[1] == "open"
        };
        if names.windows(2).any(opens) || names.iter().any(|name| name == "OpenOptions") {
            self.what.push(names.join("::"));
        }
    }

    fn imported(&mut self, before: &[String], tree: &UseTree) {
        let with = |name: &syn::Ident| [before, &[name.to_string()]].concat();
        match tree {
            UseTree::Path(path) => self.imported(&with(&path.ident), &path.tree),
            UseTree::Group(group) => group.items.iter().for_each(|tree| self.imported(before, tree)),
            UseTree::Name(name) => self.named(&with(&name.ident)),
            UseTree::Rename(rename) => {
                self.named(&with(&rename.ident));
                // Another name would hide what is called.
                if rename.ident == "fs" || rename.ident == "File" {
                    self.what.push(format!("renames {}", rename.ident));
                }
            }
            UseTree::Glob(_) if before.last().is_some_and(|last| last == "fs") => {
                self.what.push("imports all of fs".to_owned());
            }
            UseTree::Glob(_) => {}
        }
    }
}

impl Visit<'_> for Found {
    fn visit_item(&mut self, item: &Item) {
        if is_test(attributes(item)) {
            return;
        }
        if let Item::Use(item) = item {
            self.imported(&[], &item.tree);
        }
        visit::visit_item(self, item);
    }

    fn visit_impl_item(&mut self, item: &ImplItem) {
        if !matches!(item, ImplItem::Fn(item) if is_test(&item.attrs)) {
            visit::visit_impl_item(self, item);
        }
    }

    fn visit_path(&mut self, path: &Path) {
        let names: Vec<String> = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        self.named(&names);
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, of: &Macro) {
        // Tokens are printed with spaces between them.
        let text = of.tokens.to_string().replace(' ', "");
        let ways = ["fs::read", "File::open", "OpenOptions"];
        self.what
            .extend(ways.iter().filter(|way| text.contains(**way)).map(|way| format!("{way} in a macro")));
        visit::visit_macro(self, of);
    }
}
