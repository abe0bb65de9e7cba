//! Code that makes packets or changes their counts, from its sources.
//!
//! `syn` knows no types, so a change is known by the names of a packet's fields: whatever is written to one
//! of them counts, but for a field of `self` and for sums into a whole `counts` of what is no local copy, as
//! other structures have one, too. Test modules are skipped, wherever they are in a file.

use syn::visit::{self, Visit};
use syn::{Attribute, Expr, File, Item, Local, Macro, Member, Pat, Path, Type, UnOp, UseTree};

/// Types of which no code above the pipeline has a value of its own.
const TYPES: [&str; 2] = ["Packet", "PacketCounts"];
/// Fields of a packet that are not named so elsewhere, where a value is written.
const FIELDS: [&str; 6] = ["kind", "pass", "batch", "draw", "tile", "triangle"];

/// What the code of a file does to make or to change packets.
pub fn made(text: &str) -> Vec<String> {
    let parsed: File = syn::parse_file(text).expect("a source file");
    let mut found = Found::default();
    found.visit_file(&parsed);
    found.what
}

#[derive(Default)]
struct Found {
    what: Vec<String>,
    /// Names of variables that are copies of others.
    copies: Vec<String>,
}

impl Found {
    fn add(&mut self, what: impl Into<String>) {
        self.what.push(what.into());
    }

    /// A value is written to a place, or may be through a reference. `counts` of other structures are added
    /// to as a whole.
    fn written(&mut self, place: &Expr, is_added: bool) {
        let (mut at, mut is_indexed) = (place, false);
        loop {
            at = match at {
                Expr::Index(index) => {
                    is_indexed = true;
                    &index.expr
                }
                Expr::Paren(inner) => &inner.expr,
                Expr::Unary(inner) => &inner.expr,
                _ => break,
            };
        }
        let Expr::Field(field) = at else { return };
        let Member::Named(name) = &field.member else { return };
        let owner = match &*field.base {
            Expr::Path(path) => path.path.get_ident().map(ToString::to_string).unwrap_or_default(),
            _ => String::new(),
        };
        let (is_own, is_copy) = (owner == "self", self.copies.contains(&owner));
        let is_of_packet =
            FIELDS.iter().any(|of| name == of) || (name == "counts" && (is_indexed || !is_added || is_copy));
        if is_of_packet && !is_own {
            self.add(format!("writes `.{name}`"));
        }
    }

    fn imported(&mut self, tree: &UseTree) {
        match tree {
            UseTree::Path(path) => self.imported(&path.tree),
            UseTree::Group(group) => group.items.iter().for_each(|tree| self.imported(tree)),
            UseTree::Rename(rename) if is_of(&rename.ident.to_string()) => {
                self.add(format!("renames {}", rename.ident));
            }
            _ => {}
        }
    }
}

fn is_of(name: &str) -> bool {
    TYPES.contains(&name)
}

fn ends_in_packet(path: &Path) -> bool {
    path.segments.last().is_some_and(|last| is_of(&last.ident.to_string()))
}

fn is_packet(of: &Type) -> bool {
    matches!(of, Type::Path(path) if ends_in_packet(&path.path))
}

/// Whether an item is compiled for tests alone.
pub(super) fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("test")
            || attribute.path().is_ident("cfg")
                && attribute.parse_args::<Path>().is_ok_and(|path| path.is_ident("test"))
    })
}

/// Attributes of an item.
pub(super) fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

impl Visit<'_> for Found {
    fn visit_item(&mut self, item: &Item) {
        if is_test(attributes(item)) {
            return;
        }
        match item {
            Item::Use(item) => self.imported(&item.tree),
            Item::Type(item) if is_packet(&item.ty) => self.add(format!("names a packet {}", item.ident)),
            Item::Impl(item) if is_packet(&item.self_ty) => self.add("adds methods to a packet"),
            _ => {}
        }
        visit::visit_item(self, item);
    }

    fn visit_local(&mut self, local: &Local) {
        if let (Pat::Ident(name), Some(from)) = (&local.pat, &local.init)
            && is_copied(&from.expr)
        {
            self.copies.push(name.ident.to_string());
        }
        visit::visit_local(self, local);
    }

    fn visit_expr(&mut self, expr: &Expr) {
        match expr {
            Expr::Struct(made) if ends_in_packet(&made.path) => self.add("makes a packet"),
            Expr::Assign(assign) => self.written(&assign.left, false),
            Expr::Binary(binary) if is_assignment(&binary.op) => self.written(&binary.left, true),
            Expr::Reference(reference) if reference.mutability.is_some() => {
                self.written(&reference.expr, true)
            }
            _ => {}
        }
        visit::visit_expr(self, expr);
    }

    fn visit_path(&mut self, path: &Path) {
        let names: Vec<String> = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        for pair in names.windows(2) {
            if is_of(&pair[0]) && pair[1] != "NONE" {
                self.add(format!("uses {}::{}", pair[0], pair[1]));
            }
        }
        if names.iter().any(|name| name == "PacketCounts" || name == "PacketKind") {
            self.add("uses kinds or counts of packets");
        }
        visit::visit_path(self, path);
    }

    fn visit_type_reference(&mut self, of: &syn::TypeReference) {
        if of.mutability.is_some() && is_packet(&of.elem) {
            self.add("takes a packet to change it");
        }
        visit::visit_type_reference(self, of);
    }

    fn visit_macro(&mut self, of: &Macro) {
        // Tokens are printed with spaces between them.
        let text = of.tokens.to_string();
        let made =
            |name: &&str| [" {", " :: new"].iter().any(|after| text.contains(&format!("{name}{after}")));
        if TYPES.iter().any(made) {
            self.add("makes a packet in a macro");
        }
    }
}

/// `*first` or `first.clone()`.
fn is_copied(expr: &Expr) -> bool {
    match expr {
        Expr::Unary(of) => matches!(of.op, UnOp::Deref(_)),
        Expr::MethodCall(call) => call.method == "clone" || call.method == "to_owned",
        _ => false,
    }
}

fn is_assignment(op: &syn::BinOp) -> bool {
    use syn::BinOp::*;
    matches!(
        op,
        AddAssign(_)
            | SubAssign(_)
            | MulAssign(_)
            | DivAssign(_)
            | RemAssign(_)
            | BitXorAssign(_)
            | BitAndAssign(_)
            | BitOrAssign(_)
            | ShlAssign(_)
            | ShrAssign(_)
    )
}
