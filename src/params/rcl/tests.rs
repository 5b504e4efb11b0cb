use std::io::Write;

use super::*;

fn tracker() -> NodeName {
    NodeName::default()
}

/// Reads a file with this text; `name=value` of each parameter of the node, or the error.
fn read(text: &str) -> Result<String, String> {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(text.as_bytes()).unwrap();
    let mut overrides = Overrides::default();
    overrides.read(file.path()).map_err(|e| e.to_string())?;
    Ok(shown(&overrides))
}

fn shown(overrides: &Overrides) -> String {
    let shown = |o: Override| format!("{}={}", o.name, o.value.map_or("?".to_owned(), |v| v.to_string()));
    overrides.of(&tracker()).into_iter().map(shown).collect::<Vec<_>>().join(" ")
}

/// The text as the parameters of every node.
fn every(parameters: &str) -> String {
    format!("/**:\n  ros__parameters:\n    {}\n", parameters.replace('\n', "\n    "))
}

#[test]
fn what_rcl_reads_is_read() {
    for (text, want) in [
        (every("a: off\nb: [yes, NO]"), "a=false b=[true, false]"),
        (every("a: 007\nb: '007'\nc: !!str 007\nd: |-\n  7"), r#"a=7 b="007" c="007" d=7"#),
        (every("a: 18446744073709551615"), "a=1.8446744073709552e+19"),
        (every("a: true\na: false"), "a=false"),
        (every("a: ~\nb: ''\nc: \"x\\0y\""), r#"a="~" b="" c="x""#),
        (every("a: {b: {c: 1}, d: 2}"), "a.b.c=1 a.d=2"),
        (every("0: {name: left}\n1.5: x"), r#"0.name="left" 1.5="x""#),
        (every("<<: {a: 1}"), "<<.a=1"),
        (every("a: []\nb: &x [1, 2]"), "a=? b=[1, 2]"),
        (every("a: {}"), "a=?"),
        (every("a: [[1, 2]]\nb: [{c: 3}]\nd: [1, {e: 2}]"), "a=[1, 2] b.c=[3] d.e=[1, 2]"),
        // The order of types decides where a value comes twice, and a name that was a group's holds on to its place.
        (every("a: 1.5\na: 1\nb: text\nb: [1]"), r#"a=1 b="text""#),
        (every("x: {c: 1}\nx: {c: 2}\nx.c: 3"), "x.c=2"),
        (every("x: {a.b: {c: 1}, d: 2}"), "x.a.b.c=1 x.a.d=2"),
        (every("a: 1") + &every("b: 2\na: 3"), "a=3 b=2"),
        (format!("---\n{}---\n{}", every("a: 1"), every("b: 2")), "a=1 b=2"),
        ("tracker: {ros__parameters: {a: 1}}\n'/**': {ros__parameters: {a: 2}}".to_owned(), "a=2"),
        ("/*: {ros__parameters: {a: 1}}\n/**/tracker: {ros__parameters: {b: 2}}".to_owned(), "a=1 b=2"),
        ("a: {b: {ros__parameters: {x: 1}}, tracker: {ros__parameters: {x: 2}}}".to_owned(), ""),
        ("just words".to_owned(), ""),
        (String::new(), ""),
    ] {
        assert_eq!(read(&text).as_deref(), Ok(want), "{text}");
    }
}

#[test]
fn what_rcl_refuses_is_refused_with_its_place() {
    for (text, why) in [
        (every("a:"), "line 3, column 7: 'a': it has no value"),
        (
            every("a: [1, 2.0]"),
            "line 3, column 12: 'a': the items of a list must be of one type, and 2.0 is of type double",
        ),
        (every("a: &x 1\n<<: *x"), "line 4, column 9: '*x' is an alias"),
        (every("a: {}\nb: 1"), "line 4, column 8: a value below 'b' where"),
        (every("a: [[1], [2]]"), "a list where a name is expected"),
        (every("'': 1"), "line 3, column 5: a name is empty"),
        (
            every("a: 1").replace("/**", "/track*"),
            "line 2, column 3: '/track*' does not match a node: '*' matches a whole",
        ),
        ("ros__parameters: {seed: 1}".to_owned(), "'ros__parameters' must be below a node name"),
        ("/**: {seed: 1}".to_owned(), "line 1, column 13: a value below '/**/seed' where 'ros__parameters'"),
        ("/**: {ros__parameters: [1]}".to_owned(), "'ros__parameters' must hold names with values"),
        ("/**: {ros__parameters: }".to_owned(), "'ros__parameters' must hold names with values"),
        ("a: [1]".to_owned(), "line 1, column 4: a value below 'a' where"),
        ("a: [".to_owned(), "line 1, column 4: a value"),
        ("a: {\n".to_owned(), "line 2, column 1: did not find expected node content"),
        ("a:\n\t- b".to_owned(), "line 2, column 1: found character that cannot start any token"),
    ] {
        let got = read(&text).unwrap_err();
        assert!(got.contains(why), "{text}: {got}");
    }
}

#[test]
fn files_and_arguments_come_together_in_their_order() {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(every("a: 1\nb: 2\nc: 3").as_bytes()).unwrap();
    let mut overrides = Overrides::default();
    overrides.assign("a:=7").unwrap();
    overrides.assign("tracker:b:=8").unwrap();
    overrides.assign("other:c:=9").unwrap();
    assert_eq!(overrides.read(file.path()).unwrap(), ["/**"]);
    overrides.assign("c:=[off]").unwrap();
    // What names the node came after what is for every node, and so holds on.
    assert_eq!(shown(&overrides), "a=1 b=8 c=3");
    let found = overrides.of(&tracker());
    assert_eq!(found[2].kinds, [ValueKind::Integer, ValueKind::BoolArray]);
    assert_eq!(found[0].origin.place, Some(Place { line: 3, column: 8 }));
    assert!(found[0].origin.to_string().ends_with(", line 3, column 8"));
}

#[test]
fn the_values_of_arguments_are_those_of_files() {
    for (text, want) in [
        ("a:=off", "a=false"),
        ("a:=yes it is", r#"a="yes it is""#),
        ("a:=[[1],[2]]", "a=[2]"),
        ("a:=1\n---\n2", "a=2"),
        ("a:=# nothing", "a=?"),
        ("a:=b:=c", r#"a="b:=c""#),
    ] {
        let mut overrides = Overrides::default();
        overrides.assign(text).unwrap();
        assert_eq!(shown(&overrides), want, "{text}");
    }
    for (text, why) in [
        ("a", "it must read NAME:=VALUE"),
        ("a:=", "it has no value"),
        ("a:={b: 1}", "a map is not a value"),
        ("a:=*x", "'*x' is an alias"),
        ("a:=[1, x]", "of one type"),
        ("a:=[1", "did not find expected ',' or ']'"),
        ("a-b:=1", "'a-b' contains '-'"),
        ("/n:a:=1", "'/n' contains '/'"),
        ("a:=\x07", "U+0007"),
    ] {
        let got = Overrides::default().assign(text).unwrap_err().to_string();
        assert!(got.contains(why), "{text}: {got}");
    }
}

/// Processor time of this thread, in seconds, which other work on the machine does not lengthen.
fn processor_time() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

#[test]
fn no_file_takes_long() {
    let limit = (1 << 20) - 100;
    let fill = |head: &str, part: &dyn Fn(usize) -> String| {
        let mut text = head.to_owned();
        for index in 0.. {
            text.push_str(&part(index));
            if text.len() > limit {
                return text;
            }
        }
        text
    };
    let same = |head: &str, part: &str| fill(head, &|_| part.to_owned());
    let long = "k".repeat(400);
    let deep = "[".repeat(55);
    for (kind, text) in [
        ("brackets", same("", "[")),
        ("brackets in parameters", same(&every("a: "), "[")),
        ("braces", same("", "{")),
        ("maps", same("", "{a: ")),
        ("questions", same("", "? ")),
        ("deep items", same(&every(&format!("a: {deep}1")), ",1")),
        ("names", fill(&every(""), &|i| format!("p{i}: 1\n    "))),
        ("one name", same(&every(""), "p: 1\n    ")),
        ("groups", fill(&every(""), &|i| format!("p{i}: {{a: 1}}\n    "))),
        ("long names", fill(&format!("/**: {{ros__parameters: {{{long}: {{"), &|i| format!("{i}: 1,"))),
        ("nodes", fill("", &|i| format!("n{i}: {{ros__parameters: {{a: 1}}}}\n"))),
        ("wildcards", fill("", &|i| format!("/**/n{i}/**: {{ros__parameters: {{a: 1}}}}\n"))),
        ("directives", fill("", &|i| format!("%TAG !{i}! x\n"))),
        ("words", same("a: ", "x ")),
        ("escapes", same(&every("a: \""), "\\n")),
        ("lines", same(&every("a: |"), "      x\n")),
        ("anchors", fill(&every("a: ["), &|i| format!("&x{i} 1,"))),
        ("keys on a line", fill("{", &|i| format!("a{i}: {{}},"))),
    ] {
        let start = processor_time();
        let outcome = read(&text).map(|taken| taken.len());
        let took = processor_time() - start;
        assert!(took < 2.0, "{kind}: {took:.2} s, {outcome:?}");
    }
}
