//! Names that each source file below `src` takes from another one, read from `use` declarations and written paths.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::sync::LazyLock;

/// Roots of the program and of the crates that [`dcvins`] re-exports.
pub(crate) const ROOTS: [&str; 3] = ["estimation.rs", "logs.rs", "main.rs"];
/// Folder whose paths from `crate` begin in itself; the other crates of `src` re-export each other at their roots.
const OWN_CRATE: &str = "painting";

/// Path of a module below the crate's root, outermost name first.
type ModulePath = Vec<String>;

/// One source file without its tests.
struct SourceFile {
    /// Path below `src`.
    name: String,
    module: ModulePath,
    imports: Vec<Import>,
    /// Paths of two names or more outside `use` declarations.
    paths: BTreeSet<Vec<String>>,
    /// Names that stand alone or first in a path, outside `use` declarations.
    words: BTreeSet<String>,
    /// Names of the items that the file defines.
    defined: BTreeSet<String>,
}

/// One name of a `use` declaration; `*` for a glob.
struct Import {
    path: Vec<String>,
    name: String,
    public: bool,
}

/// The module or the item of a file that a path leads to.
enum Target {
    Module(usize),
    Item(usize, String),
}

/// Names that one file takes from another.
struct Edge<'a> {
    from: &'a str,
    to: &'a str,
    names: &'a BTreeSet<String>,
}

impl<'a> Edge<'a> {
    /// Children of a folder to which both files belong, if they differ.
    fn between_children(&self, folder: &str) -> Option<(&'a str, &'a str)> {
        let pair = (child_of(self.from, folder)?, child_of(self.to, folder)?);
        (pair.0 != pair.1).then_some(pair)
    }
}

/// Source files with the names that each takes from others.
pub(crate) struct Imports {
    files: Vec<SourceFile>,
    modules: BTreeMap<ModulePath, usize>,
    /// Imports between files, by their positions and ordered by their names.
    taken: Vec<(usize, usize, BTreeSet<String>)>,
}

/// Name below `src`, with `/`, and text of every Rust file, in the order of their paths.
pub(crate) fn source_files() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut open = vec![root.clone()];
    let mut files = Vec::new();
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).expect("the folder can be listed") {
            let path = entry.expect("the entry can be read").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let inside = path.strip_prefix(&root).expect("the file is below the root");
                let name = inside.to_string_lossy().replace('\\', "/");
                files.push((name, fs::read_to_string(&path).expect("the source is UTF-8")));
            }
        }
    }
    files.sort();
    files
}

impl Imports {
    /// All files below `src` but `main.rs` and the files of tests, read once.
    pub(crate) fn read() -> &'static Self {
        static IMPORTS: LazyLock<Imports> = LazyLock::new(|| {
            let library =
                source_files().into_iter().filter(|(name, _)| !ROOTS.contains(&name.as_str()) && !is_test_file(name));
            Imports::of(library.collect())
        });
        &IMPORTS
    }

    /// Reads files given as name below `src` and text.
    pub(crate) fn of(mut texts: Vec<(String, String)>) -> Self {
        texts.sort();
        let files: Vec<SourceFile> = texts.into_iter().map(|(name, text)| SourceFile::parse(name, &text)).collect();
        let modules = files.iter().enumerate().map(|(index, file)| (file.module.clone(), index)).collect();
        let mut imports = Self { files, modules, taken: Vec::new() };
        let of_file = |from: usize| imports.taken_by(from).into_iter().map(move |(to, names)| (from, to, names));
        imports.taken = (0..imports.files.len()).flat_map(of_file).collect();
        imports
    }

    fn edges(&self) -> Vec<Edge<'_>> {
        let name = |index: &usize| self.files[*index].name.as_str();
        self.taken.iter().map(|(from, to, names)| Edge { from: name(from), to: name(to), names }).collect()
    }

    /// Circles of files that import each other: per circle one line `from -> to: names` per import inside it.
    pub(crate) fn circles(&self) -> Vec<Vec<String>> {
        let edges = self.edges();
        let groups = circles_of(edges.iter().map(|edge| (edge.from, edge.to)));
        let inside =
            |group: &BTreeSet<&str>| lines(&edges, |edge| group.contains(edge.from) && group.contains(edge.to));
        groups.iter().map(inside).collect()
    }

    /// Circles between the files and subfolders of one folder, whose imports count for the whole subfolder: by
    /// `folder: child child …` the imports inside the circle.
    pub(crate) fn sibling_circles(&self) -> BTreeMap<String, Vec<String>> {
        let edges = self.edges();
        let mut circles = BTreeMap::new();
        for folder in self.folders() {
            let pairs = edges.iter().filter_map(|edge| edge.between_children(folder));
            for group in circles_of(pairs) {
                let is_inside = |(from, to): (&str, &str)| group.contains(from) && group.contains(to);
                let key = format!("{folder}: {}", group.iter().copied().collect::<Vec<_>>().join(" "));
                circles.insert(key, lines(&edges, |edge| edge.between_children(folder).is_some_and(is_inside)));
            }
        }
        circles
    }

    /// Imports of files in subfolders from a loose file of a folder around them that is not on the folder's ground
    /// floor, by this loose file. A loose file is on the ground floor if it uses no subfolder of its folder, neither
    /// itself nor through other loose files.
    pub(crate) fn arrows_up(&self) -> BTreeMap<&str, Vec<String>> {
        let edges = self.edges();
        let mut arrows = BTreeMap::new();
        for folder in self.folders() {
            let is_loose = |name: &str| child_of(name, folder).is_some_and(is_file);
            let is_deeper = |name: &str| child_of(name, folder).is_some_and(|child| !is_file(child));
            let mut upper: BTreeSet<&str> = BTreeSet::new();
            loop {
                let before = upper.len();
                let uses = |edge: &&Edge<'_>| is_loose(edge.from) && (is_deeper(edge.to) || upper.contains(edge.to));
                upper = edges.iter().filter(uses).map(|edge| edge.from).collect();
                if upper.len() == before {
                    break;
                }
            }
            for file in upper {
                let imports = lines(&edges, |edge| edge.to == file && is_deeper(edge.from));
                if !imports.is_empty() {
                    arrows.insert(file, imports);
                }
            }
        }
        arrows
    }

    /// Imports from a file or folder to those that it must not import, except those inside the first; names are below
    /// `src`, without `.rs`.
    pub(crate) fn against(&self, rules: &[(&str, &[&str])]) -> Vec<String> {
        let is_in = |name: &str, place: &&str| {
            let rest = name.strip_prefix(*place);
            rest.is_some_and(|rest| rest.starts_with('/') || rest == ".rs")
        };
        let breaks = |edge: &Edge<'_>, (from, others): &(&str, &[&str])| {
            is_in(edge.from, from) && !is_in(edge.to, from) && others.iter().any(|other| is_in(edge.to, other))
        };
        lines(&self.edges(), |edge| rules.iter().any(|rule| breaks(edge, rule)))
    }

    /// Folders below `src`, subfolders included.
    fn folders(&self) -> BTreeSet<&str> {
        let of_file = |file: &'_ SourceFile| file.name.match_indices('/').map(|(at, _)| at).collect::<Vec<_>>();
        self.files.iter().flat_map(|file| of_file(file).into_iter().map(|at| &file.name[..at])).collect()
    }

    /// Files that a file takes names from, with these names.
    fn taken_by(&self, index: usize) -> BTreeMap<usize, BTreeSet<String>> {
        let file = &self.files[index];
        let mut taken: BTreeMap<usize, BTreeSet<String>> = BTreeMap::new();
        let mut take = |target: Option<Target>| {
            if let Some(Target::Item(other, name)) =
                target.filter(|target| !matches!(target, Target::Item(other, _) if *other == index))
            {
                taken.entry(other).or_default().insert(name);
            }
        };
        for import in &file.imports {
            if import.name == "*" {
                if let Some(Target::Module(module)) = self.resolve(index, &import.path, 0) {
                    file.words.iter().for_each(|word| take(self.lookup(module, word, 0)));
                }
            } else if !import.public || file.words.contains(&import.name) {
                take(self.resolve(index, &import.path, 0));
            }
        }
        file.paths.iter().for_each(|path| take(self.resolve(index, path, 0)));
        taken
    }

    /// Target of a path written in a file; `None` for other crates and for names of the file itself.
    fn resolve(&self, from: usize, path: &[String], depth: usize) -> Option<Target> {
        let (first, rest) = path.split_first()?;
        let module = &self.files[from].module;
        match first.as_str() {
            "crate" if module.first().is_some_and(|folder| folder == OWN_CRATE) => {
                self.walk(*self.modules.get(&vec![OWN_CRATE.to_owned()])?, rest, depth)
            }
            "crate" | "dcvins" => self.walk(*self.modules.get(&Vec::new())?, rest, depth),
            "self" if rest.first().is_some_and(|next| next == "super") => self.resolve(from, rest, depth),
            "self" => self.walk(from, rest, depth),
            "super" => {
                let supers = path.iter().take_while(|part| *part == "super").count();
                let parent = self.modules.get(&module[..module.len().checked_sub(supers)?])?;
                self.walk(*parent, &path[supers..], depth)
            }
            _ => match self.lookup(from, first, depth)? {
                Target::Module(next) => self.walk(next, rest, depth),
                item @ Target::Item(..) => Some(item),
            },
        }
    }

    /// Target of the names `rest`, starting at a module.
    fn walk(&self, module: usize, rest: &[String], depth: usize) -> Option<Target> {
        let Some((first, rest)) = rest.split_first() else { return Some(Target::Module(module)) };
        match self.lookup(module, first, depth) {
            Some(Target::Module(next)) => self.walk(next, rest, depth),
            Some(item) => Some(item),
            None => Some(Target::Item(module, first.clone())),
        }
    }

    /// Target of a name in the scope of a module: own item, child, import or glob import.
    fn lookup(&self, module: usize, name: &str, depth: usize) -> Option<Target> {
        let file = &self.files[module];
        if depth > 20 {
            return None;
        }
        let child = [file.module.as_slice(), &[name.to_owned()]].concat();
        if let Some(child) = self.modules.get(&child) {
            return Some(Target::Module(*child));
        }
        if file.defined.contains(name) {
            return Some(Target::Item(module, name.to_owned()));
        }
        if let Some(import) = file.imports.iter().find(|import| import.name == name) {
            return self.resolve(module, &import.path, depth + 1);
        }
        file.imports.iter().filter(|import| import.name == "*").find_map(|import| {
            match self.resolve(module, &import.path, depth + 1)? {
                Target::Module(other) if other != module => self.lookup(other, name, depth + 1),
                _ => None,
            }
        })
    }
}

/// Groups of nodes that reach each other along the pairs `(from, to)`.
fn circles_of<'a>(pairs: impl Iterator<Item = (&'a str, &'a str)>) -> Vec<BTreeSet<&'a str>> {
    let mut next: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    pairs.for_each(|(from, to)| {
        next.entry(from).or_default().insert(to);
    });
    let reached: BTreeMap<&str, BTreeSet<&str>> = next.keys().map(|from| (*from, reachable(&next, from))).collect();
    let reaches = |from: &str, to: &str| reached.get(from).is_some_and(|nodes| nodes.contains(to));
    let group = |node: &&'a str| reached[*node].iter().copied().filter(|other| reaches(other, node)).collect();
    let groups: BTreeSet<BTreeSet<&str>> = next.keys().map(group).collect();
    groups.into_iter().filter(|group| !group.is_empty()).collect()
}

/// Nodes that can be reached from one by one step or more.
fn reachable<'a>(next: &BTreeMap<&'a str, BTreeSet<&'a str>>, from: &'a str) -> BTreeSet<&'a str> {
    let mut reached = BTreeSet::new();
    let mut open = vec![from];
    while let Some(node) = open.pop() {
        open.extend(next.get(node).into_iter().flatten().filter(|other| reached.insert(**other)));
    }
    reached
}

/// First name of a path below a folder: a file or a subfolder.
fn child_of<'a>(name: &'a str, folder: &str) -> Option<&'a str> {
    name.strip_prefix(folder)?.strip_prefix('/')?.split('/').next()
}

/// True for a child of a folder that is a file: only files have an ending.
fn is_file(child: &str) -> bool {
    child.contains('.')
}

/// Lines `from -> to: names` of the chosen imports.
fn lines(edges: &[Edge<'_>], is_chosen: impl Fn(&Edge<'_>) -> bool) -> Vec<String> {
    let line = |edge: &Edge<'_>| {
        let names: Vec<&str> = edge.names.iter().map(String::as_str).collect();
        format!("{} -> {}: {}", edge.from, edge.to, names.join(", "))
    };
    edges.iter().filter(|edge| is_chosen(edge)).map(line).collect()
}

/// Whether a file below `src` holds tests only, by its name or that of its folder.
pub(crate) fn is_test_file(name: &str) -> bool {
    name.split('/').any(|part| part.starts_with("tests") || part.ends_with("_tests.rs"))
}

impl SourceFile {
    fn parse(name: String, text: &str) -> Self {
        let tokens = without_inline_modules(&without_tests(&tokens(text)));
        let (mut imports, mut code) = (Vec::new(), Vec::new());
        let mut at = 0;
        while at < tokens.len() {
            if tokens[at] == "use" && tokens.get(at + 1).is_some_and(|next| next != "<") {
                let end = at + tokens[at..].iter().position(|token| token == ";").unwrap_or(tokens.len() - at - 1);
                let public = at > 0 && (tokens[at - 1] == "pub" || tokens[at - 1] == ")");
                entries(&tokens[at + 1..end], &[], public, &mut imports);
                at = end + 1;
            } else {
                code.push(tokens[at].clone());
                at += 1;
            }
        }
        let (mut paths, mut words, mut defined) = (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
        let is_name = |token: &String| token.starts_with(|letter: char| letter.is_alphabetic() || letter == '_');
        for at in 0..code.len() {
            let before = if at > 0 { code[at - 1].as_str() } else { "" };
            if !is_name(&code[at]) || matches!(before, "::" | ".") {
                continue;
            }
            if matches!(before, "fn" | "struct" | "enum" | "trait" | "const" | "static" | "type" | "union") {
                defined.insert(code[at].clone());
                continue;
            }
            let mut path = vec![code[at].clone()];
            let mut next = at + 1;
            while next + 1 < code.len() && code[next] == "::" && is_name(&code[next + 1]) {
                path.push(code[next + 1].clone());
                next += 2;
            }
            words.insert(path[0].clone());
            if path.len() > 1 {
                paths.insert(path);
            }
        }
        let module = name.trim_end_matches(".rs").split('/').map(str::to_owned);
        let module = module.filter(|part| part != "mod" && part != "lib").collect();
        Self { name, module, imports, paths, words, defined }
    }
}

/// Adds the names of a `use` tree, read below the path `prefix`.
fn entries(tree: &[String], prefix: &[String], public: bool, imports: &mut Vec<Import>) {
    let mut path = prefix.to_vec();
    let mut at = 0;
    while at < tree.len() {
        match tree[at].as_str() {
            "{" => {
                let (mut depth, mut start) = (0_usize, at + 1);
                for (index, token) in tree.iter().enumerate().skip(at) {
                    match token.as_str() {
                        "{" => depth += 1,
                        "}" => depth -= 1,
                        _ => {}
                    }
                    if (depth == 1 && token == ",") || depth == 0 {
                        entries(&tree[start..index], &path, public, imports);
                        start = index + 1;
                    }
                    if depth == 0 {
                        break;
                    }
                }
                return;
            }
            "*" => return imports.push(Import { path, name: "*".to_owned(), public }),
            "::" => {}
            "as" => return imports.push(Import { path, name: tree[at + 1].clone(), public }),
            // `use module::{self, …}` names the module.
            "self" if at > 0 || !prefix.is_empty() => {}
            name => path.push(name.to_owned()),
        }
        at += 1;
    }
    if let Some(name) = path.last().cloned().filter(|_| !tree.is_empty()) {
        imports.push(Import { path, name, public });
    }
}

/// Names, `::` and single punctuation characters of a source text, without comments, literals and lifetimes.
fn tokens(text: &str) -> Vec<String> {
    let letters: Vec<char> = text.chars().collect();
    let is_part = |at: usize| letters.get(at).is_some_and(|letter: &char| letter.is_alphanumeric() || *letter == '_');
    let starts = |at: usize, wanted: &str| wanted.chars().enumerate().all(|(i, c)| letters.get(at + i) == Some(&c));
    let mut tokens = Vec::new();
    let mut at = 0;
    while at < letters.len() {
        let letter = letters[at];
        if starts(at, "//") {
            while at < letters.len() && letters[at] != '\n' {
                at += 1;
            }
        } else if letter == '"' {
            at = end_of_text(&letters, at);
        } else if letter == '\'' {
            // A lifetime has no closing quotation mark behind its first letter.
            if letters.get(at + 1) == Some(&'\\') {
                at += 3;
                while letters.get(at).is_some_and(|letter| *letter != '\'') {
                    at += 1;
                }
                at += 1;
            } else if letters.get(at + 2) == Some(&'\'') {
                at += 3;
            } else {
                at += 1;
                while is_part(at) {
                    at += 1;
                }
            }
        } else if is_part(at) {
            let start = at;
            while is_part(at) {
                at += 1;
            }
            let word: String = letters[start..at].iter().collect();
            let hashes = letters[at..].iter().take_while(|letter| **letter == '#').count();
            if matches!(word.as_str(), "r" | "br") && letters.get(at + hashes) == Some(&'"') {
                at = end_of_raw_text(&letters, at + hashes, hashes);
            } else {
                tokens.push(word);
            }
        } else if starts(at, "::") {
            tokens.push("::".to_owned());
            at += 2;
        } else {
            if !letter.is_whitespace() {
                tokens.push(letter.to_string());
            }
            at += 1;
        }
    }
    tokens
}

/// Position behind a text whose opening quotation mark stands at `at`.
fn end_of_text(letters: &[char], at: usize) -> usize {
    let mut at = at + 1;
    while at < letters.len() && letters[at] != '"' {
        at += if letters[at] == '\\' { 2 } else { 1 };
    }
    at + 1
}

/// Position behind a raw text whose opening quotation mark stands at `at`, behind so many `#`.
fn end_of_raw_text(letters: &[char], at: usize, hashes: usize) -> usize {
    let closes = |at: usize| letters[at] == '"' && (1..=hashes).all(|i| letters.get(at + i) == Some(&'#'));
    (at + 1..letters.len()).find(|at| closes(*at)).map_or(letters.len(), |at| at + 1 + hashes)
}

/// Leaves out items behind `#[cfg(test)]` or `#[cfg(all(test, …))]`.
fn without_tests(tokens: &[String]) -> Vec<String> {
    let mut kept = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        let is = |offset: usize, wanted: &str| tokens.get(at + offset).is_some_and(|token| token == wanted);
        let end = at + tokens[at..].iter().position(|token| token == "]").unwrap_or(0);
        let attribute = &tokens[at..end];
        if is(0, "#") && is(1, "[") && is(2, "cfg") && attribute.iter().any(|token| token == "test") {
            at = end_of_item(tokens, end + 1);
        } else {
            kept.push(tokens[at].clone());
            at += 1;
        }
    }
    kept
}

/// Names the items of inline modules as if they stood in the file: `super` becomes `self`.
fn without_inline_modules(tokens: &[String]) -> Vec<String> {
    let (mut kept, mut depth, mut inside) = (Vec::new(), 0_usize, Vec::new());
    for (at, token) in tokens.iter().enumerate() {
        match token.as_str() {
            "{" => {
                if at >= 2 && tokens[at - 2] == "mod" {
                    inside.push(depth);
                }
                depth += 1;
            }
            "}" => {
                depth = depth.saturating_sub(1);
                if inside.last() == Some(&depth) {
                    inside.pop();
                }
            }
            _ => {}
        }
        let leaves = token == "super" && !inside.is_empty() && tokens[at - 1] != "::";
        kept.push(if leaves { "self".to_owned() } else { token.clone() });
    }
    kept
}

/// Position behind the item that starts at `at`: behind its `;`, or behind the brace that closes it.
fn end_of_item(tokens: &[String], mut at: usize) -> usize {
    let mut depth = 0_usize;
    while at < tokens.len() {
        match tokens[at].as_str() {
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => depth = depth.saturating_sub(1),
            _ => {}
        }
        at += 1;
        if depth == 0 && matches!(tokens[at - 1].as_str(), ";" | "}") {
            return at;
        }
    }
    at
}
