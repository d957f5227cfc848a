use super::part21::Exchange;
use super::values::{Value, decoded};

#[test]
fn instances_are_read_in_all_spellings() {
    let text = "DATA;\n/* not #1=this; */ #1 = thing ( 'it''s; (not) ', 1, -2.5e-3, 1D2,\n .T., \
                $, *, #7, ((1.),()), TYPED(3.), \"0F\", ) ;#2=(A(1)B()RATIONAL_B_SPLINE_CURVE((1.)));\n\
                #1=AGAIN();nonsense;ENDSEC;END-ISO-10303-21;";
    let exchange = Exchange::new(text.as_bytes(), 10).unwrap();
    assert_eq!(exchange.ids().collect::<Vec<_>>(), [1, 2]);
    assert_eq!(exchange.doubled, Some((4, 1)));
    assert_eq!(exchange.stray, Some((4, 1)));
    assert!(exchange.is_ended);
    let record = exchange.get(1).unwrap();
    assert_eq!(record.name(), "THING");
    let at = record.attributes();
    assert_eq!(at.text(0), "it's; (not) ");
    let numbers = [1, 2, 3].map(|place| at.number(place).unwrap());
    assert_eq!(
        numbers.map(f64::to_bits),
        [1.0, -2.5e-3, 100.0].map(f64::to_bits)
    );
    assert!(at.is_true(4, false));
    assert_eq!(
        (at.get(5), at.get(6)),
        (Some(&Value::Nothing), Some(&Value::Nothing))
    );
    assert_eq!(at.reference(7), Ok(7));
    let nested = [
        Value::List(vec![Value::Number(1.0)]),
        Value::List(Vec::new()),
    ];
    assert_eq!(at.list(8).unwrap(), nested);
    assert_eq!(at.number(9), Ok(3.0));
    assert_eq!((at.get(10), at.get(11)), (Some(&Value::Word(b"0F")), None));
    let record = exchange.get(2).unwrap();
    assert_eq!(record.part("A").unwrap().count(0), Ok(1));
    assert!(record.part("B").is_some() && record.part("C").is_none());
    assert_eq!(exchange.source(2), "#2 RATIONAL_B_SPLINE_CURVE");
    assert!(Exchange::new(text.as_bytes(), 1).is_err());
}

#[test]
fn complex_instances_of_some_types_are_as_simple_ones() {
    let text = "DATA;#1=(BOUNDED_CURVE()COMPOSITE_CURVE((#5),.F.)COMPOSITE_CURVE_ON_SURFACE()\
                REPRESENTATION_ITEM('name'));\
                #2=(ASSEMBLY_COMPONENT_USAGE('D')NEXT_ASSEMBLY_USAGE_OCCURRENCE()\
                PRODUCT_DEFINITION_RELATIONSHIP('1','2','3',#6,#7)PRODUCT_DEFINITION_USAGE());";
    let exchange = Exchange::new(text.as_bytes(), 10).unwrap();
    let curve = exchange.get(1).unwrap();
    assert_eq!((curve.name(), curve.parts.len()), ("COMPOSITE_CURVE", 1));
    assert_eq!(curve.attributes().text(0), "name");
    assert_eq!(curve.attributes().references(1), Ok(vec![5]));
    assert_eq!(exchange.source(1), "#1 COMPOSITE_CURVE");
    let usage = exchange.get(2).unwrap();
    assert_eq!(usage.name(), "NEXT_ASSEMBLY_USAGE_OCCURRENCE");
    let at = usage.attributes();
    assert_eq!((at.reference(3), at.reference(4)), (Ok(6), Ok(7)));
    assert_eq!(at.text(5), "D");
}

#[test]
fn parts_of_complex_instances_may_stand_in_any_order() {
    let text = b"DATA;#1=(MIDDLE(2,'(B)') /* (A) */ LAST(3)FIRST(1));#2=(LAST()FIRST());";
    let exchange = Exchange::new(text, 10).unwrap();
    assert_eq!(exchange.keyword(1), b"FIRST");
    assert_eq!(exchange.keyword(2), b"FIRST");
    let record = exchange.get(1).unwrap();
    let names: Vec<_> = record.parts.iter().map(|part| part.0.as_str()).collect();
    assert_eq!(names, ["FIRST", "LAST", "MIDDLE"]);
    assert_eq!(record.attributes().number(0), Ok(1.0));
}

#[test]
fn instances_end_where_the_next_one_begins() {
    let text = "DATA;\n#1=A('#9=B()')\n#2 = C((1))\n #3=D(#1);\n#4=&SCOPE #5=E();ENDSCOPE F();";
    let exchange = Exchange::new(text.as_bytes(), 10).unwrap();
    assert_eq!(exchange.ids().collect::<Vec<_>>(), [1, 2, 3, 4, 5]);
    assert_eq!(exchange.unended, Some((2, 2)));
    assert_eq!(exchange.get(1).unwrap().attributes().text(0), "#9=B()");
    assert_eq!(exchange.get(2).unwrap().name(), "C");
    assert_eq!(exchange.get(3).unwrap().attributes().reference(0), Ok(1));
}

#[test]
fn instances_that_end_early_say_where() {
    let exchange = Exchange::new(b"DATA;#5=A((1,2);#6=B(1,?);", 10).unwrap();
    let problem = |id| exchange.get(id).unwrap_err().to_string();
    assert_eq!(
        problem(5),
        "#5 A ends early; a list or string is not closed"
    );
    assert_eq!(problem(6), "#6 B is not readable from \"?)\" on");
    assert_eq!(problem(7), "#7 is wanted, but not there");
    let deep = format!("DATA;#1=A({}{});", "(".repeat(100_000), ")".repeat(100_000));
    assert!(Exchange::new(deep.as_bytes(), 10).unwrap().get(1).is_err());
}

#[test]
fn scopes_of_old_files_hold_instances() {
    let text = "DATA;#9=&SCOPE #1=A(1);#2=B(2);ENDSCOPE/#1,#2/C(#1,#2);#10=D();";
    let exchange = Exchange::new(text.as_bytes(), 10).unwrap();
    let names = exchange.ids().map(|id| exchange.source(id));
    assert_eq!(names.collect::<Vec<_>>(), ["#1 A", "#2 B", "#9 C", "#10 D"]);
    assert_eq!(exchange.get(9).unwrap().attributes().reference(1), Ok(2));
}

#[test]
fn escapes_of_strings_are_undone() {
    for (text, plain) in [
        ("a''b\\\\c", "a'b\\c"),
        ("\\X\\E4\\X\\e4", "ää"),
        ("\\S\\d\\PA\\x", "äx"),
        ("\\X2\\00E403B1\\X0\\!", "äα!"),
        ("\\X2\\D83DDE00\\X0\\", "😀"),
        ("\\X4\\0001F600\\X0\\", "😀"),
        ("\\X\\zz\\Q", "\\X\\zz\\Q"),
        ("two\n lines", "two lines"),
    ] {
        assert_eq!(decoded(text.as_bytes()), plain, "{text}");
    }
    assert_eq!(decoded(b"\xe4"), "ä");
}
