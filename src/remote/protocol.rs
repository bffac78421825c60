//! The ways in which stores accept statements.

use crate::upload::Statement;

/// A way to send statements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Protocol {
    /// SPARQL 1.1 Update: `INSERT DATA`.
    #[default]
    Update,
    /// SPARQL 1.1 Graph Store HTTP Protocol: one POST of N-Triples for each graph.
    GraphStore,
    /// POST of N-Quads, which many stores accept although no standard has it.
    Quads,
}

/// The body of an update that inserts statements, which are sorted by graph. Statements about the
/// nodes `replaced` in the default graph are removed by the same update.
pub(crate) fn update(statements: &[Statement], replaced: &[String]) -> String {
    let mut text = String::new();
    for node in replaced {
        text.push_str(&format!("DELETE WHERE {{ <{node}> ?p ?o }} ;\n"));
    }
    text.push_str("INSERT DATA {\n");
    for group in by_graph(statements) {
        let graph = group[0].0.as_deref();
        if let Some(graph) = graph {
            text.push_str(&format!("GRAPH <{graph}> {{\n"));
        }
        lines(group, &mut text);
        if graph.is_some() {
            text.push_str("}\n");
        }
    }
    text.push_str("}\n");
    text
}

/// Statements of one graph as N-Triples.
pub(crate) fn triples(statements: &[Statement]) -> String {
    let mut text = String::new();
    lines(statements, &mut text);
    text
}

/// Statements as N-Quads.
pub(crate) fn quads(statements: &[Statement]) -> String {
    let mut text = String::new();
    for (graph, triple) in statements {
        text.push_str(triple);
        if let Some(graph) = graph {
            text.push_str(&format!(" <{graph}>"));
        }
        text.push_str(" .\n");
    }
    text
}

/// Groups of statements of the same graph. They must be sorted by graph.
pub(crate) fn by_graph(statements: &[Statement]) -> impl Iterator<Item = &[Statement]> {
    statements.chunk_by(|(a, _), (b, _)| a == b)
}

fn lines(statements: &[Statement], text: &mut String) {
    for (_, triple) in statements {
        text.push_str(triple);
        text.push_str(" .\n");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statements_are_written_for_each_protocol() {
        let of = |graph: Option<&str>, triple: &str| (graph.map(str::to_owned), triple.to_owned());
        let statements = [
            of(None, "<a> <b> 1"),
            of(None, "<a> <b> 2"),
            of(Some("g"), "<a> <b> 3"),
        ];
        assert_eq!(
            update(&statements, &["a".to_owned()]),
            "DELETE WHERE { <a> ?p ?o } ;\nINSERT DATA {\n<a> <b> 1 .\n<a> <b> 2 .\nGRAPH <g> {\n<a> <b> 3 .\n}\n}\n"
        );
        assert_eq!(
            quads(&statements),
            "<a> <b> 1 .\n<a> <b> 2 .\n<a> <b> 3 <g> .\n"
        );
        let groups: Vec<String> = by_graph(&statements).map(triples).collect();
        assert_eq!(groups, ["<a> <b> 1 .\n<a> <b> 2 .\n", "<a> <b> 3 .\n"]);
    }
}
