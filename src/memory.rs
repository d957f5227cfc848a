//! Memory in large pages.

/// Makes room for so many more items, in large pages where there are many: the system hands
/// these out several times as fast as small ones.
pub(crate) fn reserve<T>(items: &mut Vec<T>, more: usize) {
    // Where there is too little, there may be enough for what is needed in the end.
    if items.try_reserve_exact(more).is_err() {
        return;
    }
    #[cfg(target_os = "linux")]
    {
        const PAGE: usize = 1 << 12;
        const LARGE_PAGE: usize = 1 << 21;
        let start = items.as_mut_ptr() as usize;
        let end = start + items.capacity() * size_of::<T>();
        let first = start.next_multiple_of(PAGE);
        if end > first + LARGE_PAGE {
            // What it answers does not matter: small pages will do.
            #[expect(
                unsafe_code,
                reason = "advice about memory that is ours changes nothing in it"
            )]
            unsafe {
                libc::madvise(
                    first as *mut libc::c_void,
                    (end - first) & !(PAGE - 1),
                    libc::MADV_HUGEPAGE,
                );
            }
        }
    }
}
